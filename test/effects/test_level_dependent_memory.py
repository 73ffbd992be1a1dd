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

"""Plays whose weights depend on the level, against quadrature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from piezo_hysteresis.effects import AmplifierBandwidth, Arx, BoucWen, HysteresisMemory, LevelDependentMemory
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-3
SLOPES, LEVELS = st.floats(-2.0, 2.0), st.floats(-1.0, 1.0)


def output(voltage, term, c=(0.1, 0.2)):
    effects = (
        BoucWen(A=0.0, p1=0.0, p2=0.0),
        HysteresisMemory(c=c, reach=0.3, virgin=1.0),
        term,
        Arx(b=(1.0,), delay=0),
    )
    record = Record(voltage, np.zeros(len(voltage)), PERIOD, initial_voltage=0.0)
    return Model(effects, PERIOD, 1.0, 1.0).simulate(record)[0]


@given(SLOPES, SLOPES, SLOPES, LEVELS, LEVELS)
def test_a_play_contributes_the_integral_of_its_density(narrow, wide, curvature, middle, level):
    term = LevelDependentMemory(slope_narrow=narrow, slope_wide=wide, curvature=curvature, middle=middle)
    c, radii, expected = (0.1, 0.2), (0.3 / 32.0, 0.3), 0.0
    for weight, radius, k in zip(c, radii, (narrow, wide), strict=True):
        play = np.sign(level) * max(0.0, abs(level) - radius)
        expected += (
            weight * quad(lambda s, k=k: (1.0 + k * (s - middle) + curvature * (s - middle) ** 2) ** 2, 0.0, play)[0]
        )
    assert output([level], term)[0] == pytest.approx(expected, abs=1e-9)


@given(SLOPES, SLOPES, SLOPES, LEVELS)
def test_the_output_never_falls_while_the_drive_rises(narrow, wide, curvature, middle):
    """So every such operator can be inverted."""
    term = LevelDependentMemory(slope_narrow=narrow, slope_wide=wide, curvature=curvature, middle=middle)
    rising = np.concatenate((np.linspace(0.0, -1.0, 20), np.linspace(-1.0, 1.0, 400)))
    assert np.diff(output(rising, term)[20:]).min() >= -1e-12


def test_a_constant_density_is_the_play_itself():
    rng = np.random.default_rng(1)
    voltage = np.cumsum(0.1 * rng.normal(size=500))
    effects = (BoucWen(A=0.0), HysteresisMemory(c=(0.1, 0.2), reach=0.3), Arx(b=(1.0,)))
    model, record = Model(effects, PERIOD, 1.0, 1.0), Record(voltage, np.zeros(500), PERIOD, initial_voltage=0.0)
    level = model.with_effect(LevelDependentMemory(middle=0.4))
    np.testing.assert_allclose(level.simulate(record)[0], model.simulate(record)[0], atol=1e-14)


def test_slopes_equal_finite_differences_also_by_numbers_of_the_amplifier_before():
    rng = np.random.default_rng(2)
    voltage = np.sin(np.arange(3000) / 150.0) * np.linspace(0.1, 1.0, 3000) + 1e-3 * rng.normal(size=3000)
    effects = (
        AmplifierBandwidth(tau=4.0 * PERIOD),
        BoucWen(A=0.0),
        HysteresisMemory(c=(0.1, 0.05, 0.2), reach=0.6, virgin=1.0),
        LevelDependentMemory(slope_narrow=0.3, slope_wide=-0.4, curvature=0.2, middle=0.1),
        Arx(b=(1.0,), delay=2.0),
    )
    model, record = Model(effects, PERIOD, 1.0, 1.0), Record(voltage, np.zeros(3000), PERIOD, initial_voltage=0.0)
    names = [n for n in model.values() if n.partition(".")[0] not in ("arx", "bouc_wen") and not model.row(n).fixed]
    _, slopes = model.sensitivities(record, names)
    for name in names:
        step = 1e-6 * (PERIOD if name.endswith("tau") else 1.0)
        up, down = (model.with_values({name: model.values()[name] + s}).simulate(record)[0] for s in (step, -step))
        expected = (up - down) / (2.0 * step)
        np.testing.assert_allclose(slopes[name], expected, atol=1e-6 * np.abs(expected).max(), err_msg=name)
