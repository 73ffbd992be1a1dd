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

"""The error measure: closed forms, and what may not change it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import IdentificationError, ModelError
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.free_run_error import drive_frequency, errors
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

MODEL = Model((BoucWen(), Arx(b=[0.25])), sample_period=1e-3, displacement_scale=2e-5)


def measured(added, phases=("triangle", "sine_1hz", "sine_5hz", "sine_5hz")):
    """What MODEL itself would have answered, plus `added(phase number, time)` [m]."""
    records = []
    for number, phase in enumerate(phases):
        t = 1e-3 * np.arange(1500)
        u = 5 - 5 * np.cos(2 * np.pi * (number + 1) * t)
        bare = Record(u, np.zeros(t.size), 1e-3, phase=phase)
        records.append(Record(u, MODEL.simulate(bare)[0] + added(number, t), 1e-3, phase=phase))
    return Experiment(tuple(records))


def test_a_perfect_model_has_no_error_and_a_fit_of_100_percent():
    table = errors(MODEL, measured(lambda n, t: 0.0))
    assert table.rms < 1e-12 * table.range
    assert all(row.fit == pytest.approx(100.0) for row in table.rows)


def test_a_sine_of_known_amplitude_is_its_rms_in_percent_of_the_range():
    experiment = measured(lambda n, t: 1e-7 * np.sin(2 * np.pi * 50 * t) * (n == 1))
    table = errors(MODEL, experiment)
    span = max(r.displacement.max() for r in experiment) - min(r.displacement.min() for r in experiment)
    assert table.range == pytest.approx(span)
    assert table.rows[1].percent == pytest.approx(100 * 1e-7 / np.sqrt(2) / span, rel=1e-3)
    assert table.rows[1].largest == pytest.approx(1e-7, rel=1e-3)
    assert table.rows[0].percent == pytest.approx(0.0, abs=1e-6)


def test_frequencies_pool_the_repetitions_of_a_sine():
    table = errors(MODEL, measured(lambda n, t: 1e-8 * n * np.sign(np.sin(2 * np.pi * 50 * t + 0.1))))
    assert list(table.by_frequency) == [1.0, 5.0]
    assert table.by_frequency[5.0] == pytest.approx(np.hypot(table.rows[2].percent, table.rows[3].percent) / np.sqrt(2))
    assert table.by_phase["sine_5hz"] == pytest.approx(table.by_frequency[5.0])
    assert table.percent == pytest.approx(np.sqrt(np.mean([r.percent**2 for r in table.rows])))


def test_a_record_with_unknown_initial_state_is_shown_but_not_in_the_total():
    def added(number, time):
        return 1e-6 if number == 0 else 1e-8 * np.sign(np.sin(2 * np.pi * 50 * time + 0.1))

    conditioned = errors(MODEL, measured(added, ("conditioning", "triangle", "sine_1hz")))
    assert conditioned.rms == pytest.approx(1e-8, rel=1e-2)
    assert conditioned.rows[0].rms == pytest.approx(1e-6, rel=1e-2)
    assert errors(MODEL, measured(added, ("rest", "triangle", "sine_1hz"))).rms > 3e-7


@given(zero=st.floats(-1e-3, 1e-3))
def test_the_zero_of_the_sensor_does_not_matter(zero):
    wave = measured(lambda n, t: 1e-8 * np.sin(2 * np.pi * 20 * t))
    shifted = measured(lambda n, t: 1e-8 * np.sin(2 * np.pi * 20 * t) + zero)
    assert errors(MODEL, shifted).percent == pytest.approx(errors(MODEL, wave).percent, rel=1e-6)
    assert errors(MODEL, shifted).zero == pytest.approx(zero + errors(MODEL, wave).zero, abs=1e-12)


def test_one_zero_is_used_for_the_experiment_unless_it_is_free_per_record():
    drifting = measured(lambda n, t: 1e-7 * n)
    assert errors(MODEL, drifting).rms == pytest.approx(1e-7 * np.std(np.arange(4)), rel=1e-6)
    assert errors(MODEL, drifting, Nuisance(offset=True)).rms < 1e-12
    assert errors(MODEL, drifting, Nuisance()).rms == pytest.approx(1e-7 * np.sqrt(14 / 4), rel=1e-6)


def test_a_stage_that_does_not_move_has_no_range():
    still = Experiment((Record([0.0, 1.0], [1e-6, 1e-6], 1e-3),))
    with pytest.raises(IdentificationError, match="every sample"):
        errors(MODEL, still)


def test_a_record_faster_than_the_model_is_refused():
    fast = Experiment((Record(np.arange(10.0), np.arange(10.0), 1e-4),))
    with pytest.raises(ModelError, match="decimate"):
        errors(MODEL, fast)


@pytest.mark.parametrize(("phase", "frequency"), [("sine_400hz", 400.0), ("sine_0.5hz", 0.5), ("triangle", None)])
def test_the_name_of_a_sine_gives_its_frequency(phase, frequency):
    assert drive_frequency(Record([0.0], [0.0], 1.0, phase=phase)) == frequency
