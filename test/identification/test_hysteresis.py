# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The start needs no guess: any bounded loop is found from its own data."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects import Arx, BoucWen, Discretisation, Loop
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.steps.hysteresis import fit_hysteresis
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

LIMITS = DriveLimits(sample_period=1e-3)
V = np.concatenate([excitation.triangle(LIMITS, (1.0, 0.75, 0.5, 0.25), 1.0)]) / 10.0


def run(effect, v):
    block = effect.block(Discretisation(1e-3, 1e-3))
    w, _ = block.run(v, block.rest(float(v[0]), 0.0))
    return w


loops = st.builds(
    lambda a, sign, beta, ratio, p1, p2: BoucWen(A=a * sign, beta=beta, gamma=ratio * beta, p1=p1, p2=p2),
    st.floats(0.1, 2.0),
    st.sampled_from([-1.0, 1.0]),
    st.floats(1.0, 30.0),
    st.floats(-0.8, 0.8),
    st.floats(-0.3, 0.3),
    st.floats(1.0, 3.0),
)


@settings(max_examples=15, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(truth=loops, offset=st.floats(-5.0, 5.0), unit=st.sampled_from([0.1, 1.0, 40.0]))
def test_any_loop_is_found_in_any_unit_of_v(truth, offset, unit):
    w = run(truth, V)
    found = BoucWen().started([Loop(V * unit, w + offset)])
    assert found["beta"] >= abs(found["gamma"])
    assert np.std(run(found, V * unit) - w) < 1e-4 * np.ptp(w)


def test_the_published_loop_is_found_number_by_number():
    truth = BoucWen()
    found = BoucWen().started([Loop(V, run(truth, V) + 0.3)])
    for name, value in truth.values.items():
        assert found[name] == pytest.approx(value, rel=1e-3)


def test_a_continuing_loop_keeps_its_state():
    truth = BoucWen()
    w = run(truth, V)
    cut = 1700
    found = BoucWen().started([Loop(V[:cut], w[:cut], weight=0.0), Loop(V[cut:], w[cut:] + 1.0, continues=True)])
    assert found["A"] == pytest.approx(truth["A"], rel=1e-4)
    assert found["gamma"] == pytest.approx(truth["gamma"], rel=1e-3)


def test_the_fit_on_all_samples_is_within_its_uncertainty():
    truth = BoucWen()
    model = Model((truth, Arx(b=(0.5,), delay=2.0)), 1e-3, 10.0, 1e-5)
    noise = 1e-9 * np.random.default_rng(4).standard_normal(V.size)
    record = Record(10.0 * V, model.simulate(Record(10.0 * V, V, 1e-3))[0] + noise, 1e-3, "triangle")
    start = Model((BoucWen(A=-1.0, beta=1.0, gamma=0.0), Arx(b=(0.5,), delay=2.0)), 1e-3, 10.0, 1e-5)
    found = fit_hysteresis(start, [record], [0])
    deviates = [(v - truth[n.split(".")[1]]) / found.standard_errors[n] for n, v in found.values.items()]
    assert np.max(np.abs(deviates)) < 4.0
    assert found.rms[0] == pytest.approx(1e-9, rel=0.05)


@pytest.mark.parametrize("loops_", [[], [Loop(np.ones(50), np.ones(50), start=1.0)], [Loop(V, V, weight=0.0)]])
def test_without_loops_the_error_states_what_to_record(loops_):
    with pytest.raises(IdentificationError, match="triangle"):
        BoucWen().started(loops_)
