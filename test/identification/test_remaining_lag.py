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

"""The lag of the dynamics in closed form, with its error."""

import numpy as np
import pytest

from piezo_hysteresis import Experiment, Record, identify
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.steps.remaining_lag import lag
from piezo_hysteresis.model.model import Model

PERIOD = 1e-3


@pytest.mark.parametrize("a", [1.0 - 1e-7, 0.5, -0.5])
def test_the_lag_of_a_pole_and_its_error_are_known_up_to_the_edge_of_stability(a: float) -> None:
    """The slope of the lag was taken from a pole outside the unit circle, which ended an identification."""
    model = Model((BoucWen(), Arx(a=(a,), b=(1.0 + a,))), PERIOD)
    fit = Fit(model, ("arx.a[0]",), np.array([[1e-4]]), 1.0, (), (), (), True, 1)
    value, error = lag(fit)
    rest = model.with_values({"arx.a[0]": 0.0, "arx.b[0]": 1.0})
    without, _ = lag(Fit(rest, (), np.empty((0, 0)), 1.0, (), (), (), True, 1))
    assert value - without == pytest.approx(-PERIOD * a / (1.0 + a), rel=1e-6)
    assert error == pytest.approx(0.01 * PERIOD / (1.0 + a) ** 2, rel=1e-4)


def plays(voltage):
    """Displacement of a stage of play operators without dynamics [m], at rest at 0 V."""
    widths = np.linspace(0.2, 6.0, 15)
    weights, z, found = 0.1 * np.exp(-widths / 3.0), np.zeros(15), np.empty(voltage.size)
    for k, u in enumerate(voltage):
        z = np.clip(z, u - widths, u + widths)
        found[k] = u + weights @ z
    return 1e-6 * found


def test_a_loop_of_another_form_is_not_fitted_by_a_lead():
    """The pole went to -1: half a sample of lead, and a step that rings for ever."""
    rng, phase = np.random.default_rng(3), 2.0 * np.pi * PERIOD * np.arange(5000)
    drives = [(name, size * (1.0 - np.cos(phase))) for name, size in (("sine_large", 5.0), ("sine_small", 2.5))]
    records = [Record(u, plays(u) + rng.normal(0.0, 1e-8, u.size), PERIOD, name) for name, u in drives]
    model = identify(Experiment(tuple(records))).model
    assert (np.roots([1.0, *model["arx"].array("a")]) >= 0.0).all()
    step = model.simulate(np.full(1000, 5.0) * (np.arange(1000) > 10))
    assert np.ptp(step[900:]) < 1e-3 * np.ptp(step)
