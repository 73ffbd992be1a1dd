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

"""Linear physics of the plant against closed forms, and the whole chain against a general ODE solver."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import residue

from piezo_hysteresis.stage.plant import Plant

TS = 20e-6
SAME_FIXTURE = settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])


def step_response(parameters, size=400, period=TS):
    """Displacement after a step of 1 V at sample 0, from rest at 0 V."""
    return Plant(parameters, period).run(np.ones(size)).displacement


def analytic_step_response(parameters, time):
    """The same in closed form at any time after the dead time, by partial fractions in units of 10 µs."""
    unit = 1e-5
    s, electronics = parameters.structure, parameters.electronics
    num, den = np.zeros(1), np.ones(1)
    for frequency, damping, share in ((s.frequency1, s.damping1, s.share1), (s.frequency2, s.damping2, 1 - s.share1)):
        omega = 2 * math.pi * frequency * unit
        mode = np.array([1.0, 2 * damping * omega, omega**2])
        num, den = np.polyadd(np.polymul(num, mode), share * omega**2 * den), np.polymul(den, mode)
    lags = [1 / (2 * math.pi * electronics.amplifier_bandwidth)] if electronics.amplifier_bandwidth else []
    for lag in (*lags, *parameters.sensor.time_constants):
        den = np.polymul(den, [lag / unit, 1.0])
    residues, poles, _ = residue(num, den)
    gain = s.gain * parameters.hysteresis.p2 / parameters.hysteresis.voltage_scale
    growth = np.expm1(np.outer(np.maximum(time, 0.0) / unit, poles)) / poles
    return gain * (growth @ residues).real


def test_dc_gain_is_that_of_the_paper(linear):
    assert step_response(linear(), size=20000)[-1] == pytest.approx(0.24641 * 100e-6 * 2.1925 / 10, rel=1e-9)


@pytest.mark.parametrize(("period", "d"), [(10e-6, 6), (20e-6, 3), (30e-6, 2)])
def test_onset_of_a_step_is_60_us_at_several_sample_times(linear, period, d):
    """Paper, Sec. 3.2."""
    y = step_response(linear(), period=period)
    assert np.all(y[:d] < 5e-4 * y[-1])
    assert y[d] > 5e-3 * y[-1]


def test_lag_near_dc_is_that_of_the_published_arx(linear):
    """98.5 µs from drive sample to reading: for a discrete step response the mean of the impulse response."""
    y = step_response(linear(), size=5000)
    assert TS * np.sum(1 - y / y[-1]) == pytest.approx(98.5e-6, abs=0.1e-6)


@SAME_FIXTURE
@given(
    delay=st.floats(0.0, 130e-6),
    period=st.sampled_from([7e-6, 20e-6, 50e-6, 1e-3]),
    bandwidth=st.sampled_from([0.0, 1e3, 10e3]),
)
def test_step_response_is_exact_for_any_dead_time_and_bandwidth(linear, delay, period, bandwidth):
    parameters = linear(electronics__delay=delay, electronics__amplifier_bandwidth=bandwidth)
    y = step_response(parameters, size=60, period=period)
    expected = analytic_step_response(parameters, np.arange(60) * period - delay)
    np.testing.assert_allclose(y, expected, atol=1e-9 * expected[-1])


def test_the_whole_chain_equals_a_general_ode_solver(ideal):
    """Amplifier, Bouc-Wen, two modes and sensor integrated in time, hold by hold, on a drive of large random steps."""
    parameters = ideal(electronics__delay=40e-6)
    drive = np.repeat(np.random.default_rng(4).uniform(0.0, 10.0, 12), 4)
    y = Plant(parameters, TS).run(drive).displacement
    p, s = parameters.hysteresis, parameters.structure
    tau_a, (tau_s,) = 1 / (2 * math.pi * parameters.electronics.amplifier_bandwidth), parameters.sensor.time_constants
    w1, w2 = 2 * math.pi * s.frequency1, 2 * math.pi * s.frequency2

    def flow(_, state, u):
        v, h, x1, d1, x2, d2, reading = state
        dv = (u / 10 - v) / tau_a
        dh = p.A * dv - p.beta * abs(dv) * h - p.gamma * dv * abs(h)
        w = p.p1 * v**3 + p.p2 * v + h
        a1 = w1**2 * (s.share1 * w - x1) - 2 * s.damping1 * w1 * d1
        a2 = w2**2 * ((1 - s.share1) * w - x2) - 2 * s.damping2 * w2 * d2
        return [dv, dh, d1, a1, d2, a2, (x1 + x2 - reading) / tau_s]

    state, expected = np.zeros(7), [0.0, 0.0]
    for u in drive[:-2]:
        expected.append(s.gain * state[6])
        state = solve_ivp(flow, (0, TS), state, args=(u,), method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
    worst = np.abs(y - expected).max() / parameters.full_stroke
    assert worst < 3e-3  # 5 V steps every 80 µs
    finer = Plant(ideal(electronics__delay=40e-6, sub_step=1.25e-6), TS).run(drive).displacement
    assert np.abs(finer - expected).max() / parameters.full_stroke < worst / 12


def test_lags_add_up_near_dc(linear):
    """A pole of τ adds τ to the lag near dc, a delay itself, wherever in the chain it stands."""

    def lag(**changes):
        y = step_response(linear(**changes), size=20000)
        return TS * np.sum(1 - y / y[-1])

    base = lag()
    tau = 1 / (2 * math.pi * 2e3)
    amplifier, sensor = 1 / (2 * math.pi * 10e3), 1 / (2 * math.pi * 7573.0)
    assert lag(electronics__extra_delay=7.3e-6) - base == pytest.approx(7.3e-6, rel=1e-2)
    assert lag(electronics__amplifier_bandwidth=2e3) - base == pytest.approx(tau - amplifier, rel=1e-2)
    assert lag(sensor__bandwidth=2e3) - base == pytest.approx(tau - sensor, rel=1e-2)
    assert lag(sensor__bandwidth=2e3, sensor__poles=3) - base == pytest.approx(3 * tau - sensor, rel=1e-2)


def test_extra_resonance_peaks_at_its_frequency_and_keeps_the_dc_gain(linear):
    changed = linear(structure__resonance_share=0.05, structure__resonance_frequency=1e3)
    impulse = np.zeros(50000)
    impulse[0] = 1.0
    gain = np.abs(np.fft.rfft(Plant(changed, TS).run(impulse).displacement))
    plain = np.abs(np.fft.rfft(Plant(linear(), TS).run(impulse).displacement))
    assert np.argmax(gain[:3000] / plain[:3000]) == pytest.approx(1000, abs=5)
    assert gain[0] == pytest.approx(plain[0], rel=1e-9)
    # (1 − r) + r M at the resonance of M, |M| = 1/2ζ
    assert gain[1000] / plain[1000] == pytest.approx(abs(0.95 + 0.05 / 0.02j), rel=5e-3)


@pytest.mark.parametrize("changes", [{"structure__softening_cubic": 0.2}, {"structure__softening_quadratic": -0.1}])
def test_softened_spring_balances_its_load(ideal, changes):
    parameters = ideal(**changes)
    s, full = parameters.structure, parameters.full_stroke
    driven = Plant(parameters, TS)
    y = driven.run(np.full(20000, 8.0)).displacement[-1]
    w = parameters.hysteresis.rise(0.0, 8.0)
    x1 = y - s.gain * (1 - s.share1) * w
    stiffness = 1 + s.softening_quadratic * x1 / full + s.softening_cubic * (x1 / full) ** 2
    assert x1 * stiffness == pytest.approx(s.gain * s.share1 * w, rel=1e-6)


def test_a_stage_settled_anywhere_stays_where_it_is(ideal):
    parameters = ideal(
        structure__softening_cubic=0.1, structure__resonance_share=0.1, creep__gamma=0.02, creep__times=[0.1],
        creep__weights=[0.02], hysteresis__backlash=0.05, electronics__amplifier_slew=1e5, hysteresis__even2=0.05,
    )  # fmt: skip
    y = Plant(parameters, TS, voltage=4.0).run(np.full(500, 4.0)).displacement
    np.testing.assert_allclose(y, y[0], rtol=1e-11)
    assert y[0] > 10e-6
