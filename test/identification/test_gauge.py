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

"""A stage is identified alike whatever the sign of its sensor, and in whatever scales and gain."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, HysteresisMemory
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.fleet.work_result import fitted_parameters
from piezo_hysteresis.identification.fit.gauge import Gauge
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.steps.comparison import compare_inputs
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PLAYS = HysteresisMemory(c=(0.02, 0.03, 0.05, 0.04, 0.06, 0.05), reach=0.8, virgin=1.0)
STAGE = Model((BoucWen(A=0.0, beta=0.0, gamma=0.0, p1=0.02, p2=0.75), PLAYS, Arx(b=[1.0], delay=2.0)), 1e-3, 10.0, 2e-5)


def recorded(sign=1.0):
    """Triangles of falling amplitude at two rates, and sines that are not fitted."""
    rng, t = np.random.default_rng(1), np.arange(1500) / 1500
    fall = 10.0 * np.select([t < 1 / 3, t < 2 / 3], [1.0, 0.7], 0.4) * (1 - np.abs(1 - 2 * (3 * t % 1)))
    drives = {"triangle": fall, "triangle_fast": fall[::10], "validation": 4.0 * (1 - np.cos(9 * t)) + np.sin(60 * t)}
    settled = {name: np.concatenate((np.zeros(50), drive)) for name, drive in drives.items()}
    outputs = {n: STAGE.simulate(u) + 5e-9 * rng.standard_normal(u.size) for n, u in settled.items()}
    return [Record(u, sign * outputs[n], 1e-3, n) for n, u in settled.items()]


@pytest.mark.parametrize("memory", [True, False])
def test_a_sensor_of_reversed_sign_changes_no_error(memory):
    """The weights of plays are not negative, so no hysteresis was found."""
    found, mirrored = (identify(recorded(sign), memory=memory) for sign in (1.0, -1.0))
    assert (HysteresisMemory.name in found.model) is memory
    assert mirrored.free_run_percent == pytest.approx(found.free_run_percent, rel=1e-6)
    assert mirrored.model.effect(Arx).dc_gain == pytest.approx(-found.model.effect(Arx).dc_gain)
    for own, other in zip(fitted_parameters(found.fit), fitted_parameters(mirrored.fit), strict=True):
        flips = own["unit"].startswith("m/V")
        value = -other["value"] if flips else other["value"]
        assert value == pytest.approx(own["value"], rel=1e-6, abs=1e-20), own["name"]
        assert other["lower"] <= other["value"] <= other["upper"]


def test_scales_and_gain_change_no_displacement():
    """The gain was ignored, and scales changed the prior of the structure."""
    records = recorded()
    found = identify(records, memory=True)
    other = identify(records, memory=True, voltage_scale=3.0, displacement_scale=1e-6, gain=0.25)
    assert other.model.effect(Arx).dc_gain == pytest.approx(0.25)
    assert (other.model.voltage_scale, other.model.displacement_scale) == (3.0, 1e-6)
    for one, two in zip(found.model.simulate(records), other.model.simulate(records), strict=True):
        np.testing.assert_allclose(two, one, rtol=0.0, atol=1e-13)
    bands = [model.standard_errors(records)[0] for model in (found.model, other.model)]
    np.testing.assert_allclose(bands[1], bands[0], rtol=1e-6)


def test_a_gain_of_the_other_sign_is_refused():
    """The message named the gain that was expected as the one that was given."""
    loops = recorded()
    natural = Gauge.natural(loops, (0,))
    assert natural == Gauge(10.0, natural.displacement_scale, 1.0)
    with pytest.raises(ParameterError, match=r"gain: got -2, .* expected 2"):
        replace(natural, gain=-2.0).require_sign(natural)
    with pytest.raises(ParameterError, match=r"gain: got -2, .* expected 2"):
        identify(loops, memory=True, gain=-2.0)


def test_a_record_of_one_sample_shows_no_direction():
    """Its covariance was not a number, and with it the sign of the whole stage was lost."""
    one = Record([0.0], [0.0], 1e-3, "triangle", initial_voltage=10.0)
    assert Gauge.natural([one, *recorded(-1.0)], (0, 1)).gain == -1.0


def test_a_sensor_of_reversed_sign_is_no_lag():
    """The lag was half a period of 500 Hz too small, and negative."""
    arx = Arx(a=(-1.2, 0.45), b=(0.15, 0.1), delay=3.0)
    model = Model((BoucWen(), arx), 1e-4, 10.0, 1e-5)
    drive = 5.0 + np.random.default_rng(1).standard_normal(4000)
    found = []
    for sign in (1.0, -1.0):
        stage = model.with_values({f"arx.b[{k}]": sign * b for k, b in enumerate(arx.array("b"))})
        record = Record(drive, stage.simulate(drive), 1e-4, "noise")
        (comparison,), _ = compare_inputs(stage, [record], [0], 3, (2, 2))
        found.append([comparison.lag_from_v, comparison.lag_from_w])
    assert found[0][1] == pytest.approx(arx.group_delay * 1e-4, rel=0.05)
    assert found[1] == pytest.approx(found[0])


def test_the_lag_above_a_mode_is_more_than_half_a_cycle():
    """The phase was wrapped: a lag of 1.26 ms at 500 Hz was said to be -0.74 ms."""
    pole = np.exp(2e-4 * np.pi * 400.0 * (-0.033 + 1j))
    a = np.real(np.poly([pole, pole.conj()]))
    model = Model((BoucWen(), Arx(a=tuple(a[1:]), b=(a.sum(),), delay=3.0)), 1e-4, 10.0, 1e-5)
    drive = 5.0 + np.random.default_rng(1).standard_normal(4000)
    (comparison,), _ = compare_inputs(model, [Record(drive, model.simulate(drive), 1e-4, "noise")], [0], 3, (2, 1))
    assert 1e-3 < comparison.lag_from_w < 1.5e-3
    assert f"the lag at 500 Hz is {comparison.lag_from_w * 1e6:.4g}" in str(comparison)
