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

"""Waveforms stay inside the limits by construction, and hold what they promise."""

from pathlib import Path

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.protocol import excitation, protocol
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits

LIMITS = DriveLimits()

some_limits = st.builds(
    lambda low, span, safe, slew, rate, period: DriveLimits(
        sample_period=period,
        voltage_min=low,
        voltage_max=low + span,
        safe_voltage=low + safe * span,
        max_slew_rate=slew * span,
        ramp_rate=rate * span,
        rest=0.01,
    ),
    st.floats(-20.0, 20.0),
    st.floats(0.5, 150.0),
    st.floats(0.0, 1.0),
    st.sampled_from([20.0, 1e3, 1e5, np.inf]),
    st.floats(2.0, 50.0),
    st.sampled_from([2e-4, 5e-4]),
)


@settings(max_examples=12)
@given(limits=some_limits, plan=st.sampled_from([protocol.paper, protocol.short]), seed=st.integers(0, 1000))
def test_every_protocol_respects_every_stage(limits, plan, seed):
    made = plan(limits, seed)
    for phase in made:
        voltage = phase.voltage
        assert np.all(np.isfinite(voltage))
        assert voltage.min() >= limits.voltage_min and voltage.max() <= limits.voltage_max
        assert voltage[0] == voltage[-1] == limits.safe_voltage
        assert phase.largest_slew <= limits.max_slew_rate * (1 + 1e-6)
        rest = limits.samples(limits.rest)
        assert np.all(voltage[:rest] == limits.safe_voltage) and np.all(voltage[-rest:] == limits.safe_voltage)


@pytest.mark.parametrize("plan", [protocol.short, protocol.rich])
def test_the_time_of_a_protocol_is_stated_where_it_is_chosen(plan):
    duration = f"{plan().summary.duration:.0f} s"
    chosen = (Path(__file__).parents[2] / "config" / "identification.yaml").read_text(encoding="utf-8")
    assert f"{plan.__name__} ({duration})" in chosen
    assert f" {duration} " in plan.__doc__


def test_the_rich_protocol_fits_the_published_stage():
    summary = protocol.rich().summary
    assert summary.voltage_min == 0.0 and summary.voltage_max == 10.0
    assert 140.0 < summary.duration < 200.0
    assert summary.stored_samples < 1_000_000
    assert "V/s" in str(summary)


def test_ramps_around_a_waveform_have_the_ramp_rate():
    phase = LIMITS.from_safe_to_safe(excitation.hold(LIMITS, 0.5, 0.01))
    assert np.max(np.abs(np.diff(phase))) <= LIMITS.ramp_rate * LIMITS.sample_period * (1 + 1e-9)
    assert phase.max() == 5.0


def test_sines_are_those_of_table_1():
    wave = excitation.sine(LIMITS, 50.0, 0.02)
    time = LIMITS.sample_period * np.arange(wave.size)
    np.testing.assert_allclose(wave, 3.5 + 2.5 * np.sin(2 * np.pi * 50.0 * time), atol=1e-12)
    assert [p.name for p in protocol.paper() if p.name.startswith("sine")] == [
        f"sine_{f}hz" for f in (1, 50, 100, 200, 300, 400)
    ]


def test_triangle_meets_every_peak_with_the_fundamental_of_1_hz():
    wave = excitation.triangle(LIMITS, (1.0, 0.4), 1.0)
    assert wave.size == 100_001
    assert wave[25_000] == 10.0 and wave[75_000] == pytest.approx(4.0)
    assert wave[50_000] == 0.0 and wave[-1] == 0.0


def test_noise_is_flat_in_its_band_and_empty_above():
    wave = excitation.noise(LIMITS, 0.012, 5e3, 1.0, 0.35, seed=3) - 3.5
    assert np.std(wave) == pytest.approx(0.12, rel=0.03)
    power = np.abs(np.fft.rfft(wave)) ** 2
    frequency = np.fft.rfftfreq(wave.size, LIMITS.sample_period)
    low, high = (
        power[(frequency > 100) & (frequency < 2500)].mean(),
        power[(frequency > 2500) & (frequency < 4900)].mean(),
    )
    assert low == pytest.approx(high, rel=0.1)
    assert power[frequency > 5200].sum() < 1e-3 * power.sum()


@pytest.mark.parametrize("period", [1e-4, 2e-4, 5e-4, 4e-3])
def test_every_drive_stays_below_the_highest_sine_that_the_sample_rate_allows(period):
    """A drive near or above the Nyquist frequency appears at another frequency."""
    limits = DriveLimits(sample_period=period)
    waves = {
        "chirp": excitation.chirp(limits, (20.0, 3000.0), 0.5, centre=0.5, amplitude=0.1),
        "mixture": excitation.mixture(limits, 20.0, seed=1),
    }
    for name, wave in waves.items():
        power = np.abs(np.fft.rfft((wave - wave.mean()) * scipy.signal.windows.tukey(wave.size, 0.1))) ** 2
        frequency = np.fft.rfftfreq(wave.size)
        assert power[frequency > 0.44].sum() < 1e-3 * power.sum(), name


def test_odd_multisine_leaves_the_even_lines_empty():
    wave = excitation.multisine(LIMITS, 10.0, 2000.0, 0.2, 2, 0.5, seed=1) - 5.0
    period = wave.size // 2
    np.testing.assert_allclose(wave[:period], wave[period:], atol=1e-12)
    lines = np.abs(np.fft.rfft(wave[:period])) / period
    assert lines[1:200:2].min() > 1e3 * lines[0:201:2].max()
    assert np.max(np.abs(wave)) == pytest.approx(2.0)


def test_the_seed_determines_the_waveform():
    first, again, other = (protocol.short(seed=s) for s in (1, 1, 2))
    assert all(np.array_equal(a.voltage, b.voltage) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.phases[3].voltage, other.phases[3].voltage)


def test_a_slew_limit_flattens_the_edges_and_keeps_the_levels():
    slow = DriveLimits(max_slew_rate=1000.0)
    wave = excitation.steps(slow, (0.2, 0.8), 0.01)
    assert wave[0] == 2.0 and wave[-1] == 8.0
    assert np.max(np.abs(np.diff(wave))) == pytest.approx(1000.0 * slow.sample_period)


@pytest.mark.parametrize(
    "make",
    [
        lambda: DriveLimits(voltage_min=5.0, voltage_max=5.0),
        lambda: DriveLimits(safe_voltage=-1.0),
        lambda: DriveLimits(ramp_rate=0.0),
        lambda: excitation.hold(LIMITS, 1.2, 1.0),
        lambda: protocol.Protocol("empty", LIMITS, ()),
        lambda: protocol.Protocol("high", LIMITS, (protocol.ProtocolPhase("step", np.array([0.0, 11.0, 0.0]), 2e-5),)),
        lambda: protocol.Protocol("unsafe", LIMITS, (protocol.ProtocolPhase("step", np.array([0.0, 1.0]), 2e-5),)),
    ],
)
def test_contradictions_are_refused_in_one_line(make):
    with pytest.raises(IdentificationError) as caught:
        make()
    assert "expected" in str(caught.value) and "\n" not in str(caught.value)
