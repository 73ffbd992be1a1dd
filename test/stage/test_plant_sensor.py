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

"""Converters, noise and what acts from outside, against their definitions."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.stage.plant import Plant, PlantParameters
from piezo_hysteresis.stage.plant.sensor import Noise, Sensor

TS = 20e-6


def difference(changed, plain, drive, period=TS, voltage=0.0):
    """What a change of the plant adds to the displacement [m]."""
    return (
        Plant(changed, period, voltage=voltage).run(drive).displacement
        - Plant(plain, period, voltage=voltage).run(drive).displacement
    )


def test_white_noise_has_the_requested_rms_and_no_correlation(ideal):
    parameters = ideal(sensor__noise=5e-4)
    y = Plant(parameters, TS, seed=3).run(np.zeros(200_000)).displacement
    sigma = 5e-4 * parameters.full_stroke
    assert y.std() == pytest.approx(sigma, rel=5 / math.sqrt(2 * y.size))
    assert abs(y.mean()) < 5 * sigma / math.sqrt(y.size)
    correlation = y[1:] @ y[:-1] / (y @ y)
    assert abs(correlation) < 5 / math.sqrt(y.size)


def test_flicker_noise_falls_with_one_over_f():
    """S(f) = r²/(f ln 10) for an rms of r per decade, from 1 Hz to 10 kHz."""
    noise = Noise(Sensor(noise=0.0, flicker=1e-3), 50e-6, TS, np.random.SeedSequence(1)).run(2**21)
    f, density = welch(noise, 1 / TS, nperseg=2**17)
    for low in (1.0, 10.0, 100.0, 1000.0):
        band = (f >= low) & (f < 10 * low)
        rms = math.sqrt(np.sum(density[band]) * f[1])
        assert rms == pytest.approx(50e-9, rel=0.2)


def test_readings_and_drive_lie_on_the_steps_of_16_bit_converters():
    parameters = PlantParameters()
    drive = np.random.default_rng(0).uniform(0.0, 10.0, 500)
    reading = Plant(parameters, TS).run(drive)
    codes = reading.displacement / (120e-6 / 65536)
    np.testing.assert_allclose(codes, np.rint(codes), atol=1e-6)
    assert np.abs(reading.voltage - drive).max() <= 20 / 65536 / 2 + 1e-12
    volts = reading.voltage / (20 / 65536)
    np.testing.assert_allclose(volts, np.rint(volts), atol=1e-9)


def test_the_converter_never_rounds_beyond_the_drive_limits():
    """6.1 V and 0.1 V are no steps of the converter; what was applied can be played again."""
    parameters = PlantParameters.from_mapping({"electronics.voltage_min": 0.1, "electronics.voltage_max": 6.1})
    applied = Plant(parameters, TS, voltage=0.1).run(np.array([0.1, 6.1])).voltage
    assert 0.1 <= applied[0] < 0.1 + 20 / 65536
    assert 6.1 - 20 / 65536 < applied[1] <= 6.1


def test_sensor_clips_at_its_range():
    y = Plant(PlantParameters.from_mapping({"sensor.offset": 50e-6}), TS).run(np.full(1000, 10.0)).displacement
    assert y.max() == 60e-6 - 120e-6 / 65536


def test_sensor_nonlinearity_is_its_polynomial(ideal):
    plain, bent = ideal(), ideal(sensor__quadratic=0.01, sensor__cubic=-0.004)
    drive = np.full(300, 9.0)
    x, full = Plant(plain, TS).run(drive).displacement, plain.full_stroke
    expected = full * (0.01 * (x / full) ** 2 - 0.004 * (x / full) ** 3)
    np.testing.assert_allclose(difference(bent, plain, drive), expected, atol=1e-18)


def test_thermal_drift_depends_on_absolute_time_only(ideal):
    warm = ideal(environment__thermal_expansion=0.5e-6, environment__temperature_time=2.0, environment__thermometer=1)
    t = 1e-3 * np.arange(4000)
    expected = -np.expm1(-t / 2.0)
    drive = 5 + 5 * np.sin(t)
    np.testing.assert_allclose(difference(warm, ideal(), drive, 1e-3, 5.0), 0.5e-6 * expected, atol=1e-15)
    plant = Plant(warm, 1e-3)
    temperature = plant.run(np.zeros(4000)).channels["temperature"]
    np.testing.assert_allclose(temperature, 293.15 + expected, rtol=1e-12)
    plant.settle(3.0)
    assert plant.run(np.zeros(1)).channels["temperature"][0] > temperature[-1], "settling does not cool the stage"


def test_gain_drift_is_proportional_to_the_reading(ideal):
    drifting = ideal(environment__gain_per_kelvin=0.004, environment__temperature_time=2.0)
    t = 1e-3 * np.arange(4000)
    drive = 5 + 5 * np.sin(t)
    y = Plant(ideal(), 1e-3, voltage=5.0).run(drive).displacement
    expected = 0.004 * -np.expm1(-t / 2.0) * y
    np.testing.assert_allclose(difference(drifting, ideal(), drive, 1e-3, 5.0), expected, atol=1e-15)


def test_mains_hum_is_there_at_rest_with_its_harmonics(ideal):
    hum = ideal(environment__hum=50e-9, environment__hum_frequency=60.0, environment__hum_harmonics=(0.1, 0.5))
    spectrum = np.abs(np.fft.rfft(Plant(hum, TS, seed=5).run(np.zeros(50_000)).displacement)) / 25_000
    assert spectrum[[60, 120, 180]] == pytest.approx([50e-9, 5e-9, 25e-9], rel=1e-6)
    spectrum[[60, 120, 180]] = 0.0
    assert spectrum.max() < 1e-15


def test_the_other_axis_moves_by_itself_and_couples(ideal):
    coupled = ideal(environment__other_amplitude=20e-6, environment__coupling=0.01)
    drive = 5 + 5 * np.sin(0.01 * np.arange(5000))
    reading = Plant(coupled, TS, seed=2).run(drive)
    own = Plant(ideal(), TS).run(drive)
    np.testing.assert_allclose(
        reading.displacement - own.displacement, 0.01 * reading.channels["other_displacement"], atol=1e-15
    )
    assert np.ptp(reading.channels["other_displacement"]) > 1e-6
    assert "other_displacement" not in own.channels


def test_slew_limit_bounds_the_slope_and_lets_slower_drives_pass(ideal):
    fast = {"electronics__amplifier_bandwidth": 0.0, "electronics__delay": 0.0}
    limited, free = ideal(electronics__amplifier_slew=25e3, **fast), ideal(**fast)
    t = TS * np.arange(5000)
    # 25 V/ms at the piezo are 1250 V/s before the amplifier, 20 x as much as this triangle asks for
    slow = 30.0 * np.minimum(t, t[-1] - t)
    np.testing.assert_allclose(difference(limited, free, slow), 0.0, atol=2e-5 * free.full_stroke)
    y = Plant(limited, TS).run(np.full(1000, 10.0)).displacement
    ramp = Plant(free, TS).run(np.minimum(1250.0 * (t[:1000] + TS / 2), 10.0)).displacement
    assert np.abs(y - ramp).max() < 2e-3 * free.full_stroke
    assert np.abs(y - Plant(free, TS).run(np.full(1000, 10.0)).displacement).max() > 0.9 * free.full_stroke


def test_slew_limited_amplifier_with_bandwidth_in_closed_form():
    """τ v̇ = clip(u − v, ±S τ): a straight line until the gap is S τ, then exponential."""
    from piezo_hysteresis.stage.plant.clock import Clock
    from piezo_hysteresis.stage.plant.electronics import Amplifier, Electronics

    electronics = Electronics(amplifier_slew=2e6, amplifier_bandwidth=2e3, delay=0.0)
    v = Amplifier(electronics, Clock.cut(TS, 0.0, 5e-6), 0.0).run(np.full(30, 10.0))
    t, slew, tau = 5e-6 * np.arange(1, v.size + 1), 1e5, 1 / (2 * math.pi * 2e3)
    turn = (10.0 - slew * tau) / slew
    expected = np.where(t < turn, slew * t, 10.0 - slew * tau * np.exp(-(t - turn) / tau))
    np.testing.assert_allclose(v, expected, rtol=1e-12)


def test_saturation_clips_at_the_rail_or_bends_before_it(ideal):
    sharp = ideal(electronics__amplifier_max=140.0)
    soft = ideal(electronics__amplifier_max=140.0, electronics__saturation_corner=4.0)
    at_rail = ideal().stroke(0.0, 7.0)
    assert Plant(sharp, TS).run(np.full(20_000, 9.0)).displacement[-1] == pytest.approx(at_rail, rel=1e-6)
    below = np.linspace(0.0, 6.5, 2000)
    np.testing.assert_array_equal(difference(sharp, ideal(), below), 0.0)
    # softplus: at the rail the corner takes c ln 2 away
    bent = Plant(soft, TS).run(np.full(20_000, 7.0)).displacement[-1]
    assert bent == pytest.approx(ideal().stroke(0.0, 7.0 - 0.2 * math.log(2)), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "value", "also"),
    [
        ("creep.slope", 0.2, "creep.gamma"),
        ("hysteresis.rate_exponent", 0.5, "hysteresis.rate_gain"),
        ("hysteresis.rate_time", 1e-3, "hysteresis.rate_gain"),
        ("hysteresis.reference_state", 0.5, "hysteresis.exponent"),
        ("structure.resonance_frequency", 500.0, "structure.resonance_share"),
        ("environment.hum_frequency", 60.0, "environment.hum"),
        ("environment.temperature_rise", 9.0, "environment.thermal_expansion"),
        ("environment.coupling", 0.5, "environment.other_amplitude"),
    ],
)
def test_an_effect_that_is_off_is_exactly_absent(name, value, also):
    """Bit for bit, whatever its other parameters are; switched on they matter."""
    drive = 5 + 4 * np.sin(0.3 * np.arange(2000))
    plain = Plant(PlantParameters(), TS, seed=1).run(drive).displacement
    off = Plant(PlantParameters().with_values({name: value}), TS, seed=1).run(drive).displacement
    np.testing.assert_array_equal(off, plain)
    size = {"hysteresis.exponent": 1.5, "environment.thermal_expansion": 1e-3, "environment.other_amplitude": 1e-5}
    on = {also: size.get(also, 1e-2 if also != "environment.hum" else 1e-6)}
    a = Plant(PlantParameters().with_values(on), TS, seed=1).run(drive).displacement
    b = Plant(PlantParameters().with_values({**on, name: value}), TS, seed=1).run(drive).displacement
    assert np.any(a != b)


def test_a_spring_that_gives_way_is_refused():
    with pytest.raises(ParameterError, match="spring"):
        PlantParameters.from_mapping({"structure.softening_quadratic": -0.4, "structure.softening_cubic": -0.3})


def test_a_sensor_too_small_for_the_stage_is_refused():
    with pytest.raises(ParameterError, match=r"sensor\.range"):
        PlantParameters.from_mapping({"structure.displacement_scale": 1e-3})
