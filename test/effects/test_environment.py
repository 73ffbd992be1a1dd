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

"""What adds to the displacement whatever the drive does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import (
    Arx,
    AxisCoupling,
    GainDrift,
    MainsHum,
    SensorBandwidth,
    SensorNonlinearity,
    ThermalDrift,
)
from piezo_hysteresis.effects import ThermalExpansion as Expansion
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD, SCALE = 1e-2, 1e-5
PLAIN = Model((Arx(a=[], b=[1.0]),), PERIOD, displacement_scale=SCALE)


def record(start: float = 0.0, **channels: np.ndarray) -> Record:
    voltage = 5.0 + np.sin(np.arange(300) / 20.0)
    return Record(voltage, np.zeros(300), PERIOD, start_time=start, **channels)


def added(effect, data: Record) -> np.ndarray:
    """What the effect adds to the displacement [m]."""
    return PLAIN.with_effect(effect).simulate(data)[0] - PLAIN.simulate(data)[0]


@pytest.mark.parametrize("start", [0.0, 77.0])
def test_drift_is_a_function_of_absolute_time(start: float) -> None:
    data = record(start)
    expected = 2e-7 * (1 - np.exp(-data.time / 60.0))
    np.testing.assert_allclose(added(ThermalDrift(D=2e-7, tau=60.0), data), expected, atol=1e-18)
    gain = added(GainDrift(g=0.01, tau=60.0), data) / PLAIN.simulate(data)[0]
    np.testing.assert_allclose(gain, 0.01 * (1 - np.exp(-data.time / 60.0)), atol=1e-12)


def test_hum_counts_time_from_the_start_of_the_record() -> None:
    hum = MainsHum(f=17.0, cosine=[1e-8, 0.0], sine=[0.0, 3e-9])
    t = np.arange(300) * PERIOD
    expected = 1e-8 * np.cos(2 * np.pi * 17.0 * t) + 3e-9 * np.sin(4 * np.pi * 17.0 * t)
    for start in (0.0, 123.4):
        np.testing.assert_allclose(added(hum, record(start)), expected, atol=1e-19)


def test_a_drifted_gain_is_at_rest_at_any_time() -> None:
    """The filter behind it starts at the level that the gain has reached."""
    model = PLAIN.with_effect(GainDrift(g=0.05, tau=60.0)).with_effect(SensorBandwidth(tau=0.1))
    still = Record(np.full(300, 5.0), np.zeros(300), PERIOD, start_time=1e4)
    y, slopes = model.sensitivities(still, ["gain_drift.g", "arx.b[0]"])
    np.testing.assert_allclose(y, y[-1], rtol=1e-12)
    np.testing.assert_allclose(slopes["gain_drift.g"], y / 1.05, rtol=1e-9)
    np.testing.assert_allclose(slopes["arx.b[0]"], y, rtol=1e-9)


@pytest.mark.parametrize(("missing", "period"), [(0, 2 * PERIOD), (3, PERIOD), (40, PERIOD)])
def test_hum_keeps_its_phase_over_gaps_and_other_sample_periods(missing: int, period: float) -> None:
    first = record(77.0)
    later = replace(first, sample_period=period, start_time=77.0 + (300 + missing) * PERIOD, continues=True)
    hum = MainsHum(f=17.3, cosine=[1e-8], sine=[3e-9])
    measured, plain = (model.simulate([first, later])[1] for model in (PLAIN.with_effect(hum), PLAIN))
    angle = 2 * np.pi * 17.3 * (later.time - 77.0)
    np.testing.assert_allclose(measured - plain, 1e-8 * np.cos(angle) + 3e-9 * np.sin(angle), atol=1e-16)


def test_hum_needs_both_parts_of_every_harmonic() -> None:
    with pytest.raises(ParameterError, match="the same number"):
        MainsHum(cosine=[0.0], sine=[0.0, 0.0])


def test_channels_add_their_contribution_and_nothing_if_missing() -> None:
    other, temperature = 1e-5 * np.cos(np.arange(300) / 9.0), 293.15 + np.linspace(0.0, 2.0, 300)
    coupling, expansion = AxisCoupling(kappa0=0.01, kappa1=50.0), Expansion(kappa=2e-7)
    np.testing.assert_allclose(
        added(coupling, record(channels={"other_displacement": other})), (0.01 + 50 * other) * other, atol=1e-18
    )
    np.testing.assert_allclose(
        added(expansion, record(channels={"temperature": temperature})), 2e-7 * (temperature - 293.15), atol=1e-18
    )
    for effect in (coupling, expansion):
        np.testing.assert_array_equal(added(effect, record()), 0.0)


def test_the_sensor_bends_the_normalised_position() -> None:
    position = PLAIN.simulate(record())[0] / SCALE
    bent = added(SensorNonlinearity(s2=0.01, s3=-0.02), record()) / SCALE
    np.testing.assert_allclose(bent, 0.01 * position**2 - 0.02 * position**3, atol=1e-14)
