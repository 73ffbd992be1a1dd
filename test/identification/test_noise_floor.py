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

"""The floor: noise of known size is found at every sample period, and nothing else is taken for noise."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from piezo_hysteresis.identification.fit.form_uncertainty import ADEQUACY
from piezo_hysteresis.identification.records.noise_floor import (
    drive_period,
    floors,
    noise_floors,
    period_scatter,
    quantum,
    stroke,
    white_noise,
)
from piezo_hysteresis.record import Record

RANDOM = np.random.default_rng(3)
SIGMA = 1e-8


def sine(frequency, period, duration, sigma=SIGMA, added=0.0, phase="sine"):
    """A stage that follows its drive with a lag, plus white noise."""
    t = period * np.arange(round(duration / period))
    u = 3.5 - 2.5 * np.cos(2 * np.pi * frequency * t)
    y = 4e-6 * (3.5 - 2.5 * np.cos(2 * np.pi * frequency * t - 0.2))
    extra = added(t) if callable(added) else added
    return Record(u, y + extra + sigma * RANDOM.normal(size=t.size), period, phase=phase)


@pytest.mark.parametrize(("frequency", "period"), [(100.0, 2e-5), (10.0, 1e-4), (1.0, 1e-3), (0.05, 1e-2)])
def test_white_noise_is_found_under_motion_a_thousand_times_larger(frequency, period):
    record = sine(frequency, period, 20_000 * period)
    assert white_noise(record) == pytest.approx(SIGMA, rel=0.05)


@pytest.mark.parametrize("frequency", [100.0, 250.0])
def test_scatter_between_periods_is_the_noise(frequency):
    assert period_scatter(sine(frequency, 2e-5, 0.4)) == pytest.approx(SIGMA, rel=0.03)


def test_the_noise_that_is_left_in_a_measured_voltage_adds_to_the_floor():
    """The stage gives 4 µm/V over a drive of 1 to 6 V, and the floors of commanded voltages stay."""
    records = [sine(100.0, 2e-5, 0.4), sine(100.0, 2e-5, 0.4)]
    commanded = noise_floors(records)
    measured = noise_floors([records[0], replace(records[1], voltage_noise=5e-3)])
    assert measured[0] == commanded[0]
    assert measured[1] == pytest.approx(np.hypot(commanded[1], 4e-6 * 5e-3), rel=0.01)


def test_scatter_includes_noise_below_the_top_of_the_spectrum():
    found = []
    for _ in range(20):  # the scatter of four hundred levels is known to a tenth
        slow = np.repeat(RANDOM.normal(size=400), 50) * 5 * SIGMA
        record = sine(100.0, 2e-5, 0.4, added=slow)
        assert white_noise(record) < 2 * SIGMA
        found.append(period_scatter(record))
    assert np.mean(found) == pytest.approx(np.sqrt(26) * SIGMA, rel=0.15)


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_mains_hum_is_not_part_of_the_floor(mains):
    record = sine(70.0, 2e-5, 0.5, added=lambda t: 10 * SIGMA * np.cos(2 * np.pi * mains * t + 1.0))
    assert drive_period(record.voltage) is not None
    assert period_scatter(record) == pytest.approx(SIGMA, rel=0.05)


def test_a_ringing_resonance_is_not_noise():
    record = sine(100.0, 2e-5, 0.4, added=lambda t: 300 * SIGMA * np.exp(-10 * t) * np.cos(2 * np.pi * 730 * t))
    assert period_scatter(record) == pytest.approx(SIGMA, rel=0.1)


def test_a_drift_is_not_noise():
    record = sine(100.0, 2e-5, 0.4, added=lambda t: 500 * SIGMA * (1 - np.exp(-t)))
    assert period_scatter(record) == pytest.approx(SIGMA, rel=0.05)


def test_a_drive_without_period_has_none():
    assert drive_period(RANDOM.normal(size=5000)) is None
    assert drive_period(np.full(500, 2.0)) is None
    assert drive_period(np.cos(2 * np.pi * np.arange(35_000) / 20_000)) is None
    assert drive_period(np.cos(2 * np.pi * np.arange(45_000) / 20_000)) == 20_000
    assert drive_period(np.tile(RANDOM.normal(size=250), 6)) == 250


def test_averaged_records_are_quieter_and_judged_at_their_own_period():
    fast = sine(5.0, 2e-5, 1.0)
    slow = fast.decimate(25)
    noise = noise_floors((fast, slow))
    assert noise[1] == pytest.approx(noise[0] / 5, rel=0.1)


def test_quantisation_is_noise_of_one_step_over_root_twelve():
    record = sine(100.0, 2e-5, 0.4, sigma=0.0)
    step = 2e-7
    rounded = Record(record.voltage, np.rint(record.displacement / step) * step, 2e-5)
    assert quantum(rounded) == pytest.approx(step)
    assert noise_floors((rounded,))[0] == pytest.approx(step / np.sqrt(12), rel=0.3)
    assert quantum(sine(100.0, 2e-5, 0.4)) == 0.0


@pytest.mark.parametrize("size", [8, 12, 20, 31])
def test_motion_in_a_few_samples_is_not_noise(size):
    wave = np.sin(2 * np.pi * np.arange(size) / 20)
    assert white_noise(Record(wave, wave, 1e-3)) < 0.02
    rest = [Record(np.zeros(size), SIGMA * RANDOM.normal(size=size), 1e-3) for _ in range(400)]
    assert np.median([white_noise(r) for r in rest]) == pytest.approx(SIGMA, rel=0.2)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_record_too_short_for_a_spectrum_has_a_finite_floor(size):
    """A floor that is not a number ended the fits of a whole experiment."""
    short = Record(np.zeros(size), 1e-8 * np.arange(size), 2e-5)
    found = noise_floors([sine(100.0, 2e-5, 0.2), short])
    assert np.isfinite(found).all() and found[1] >= 0.0


def test_no_floor_lies_below_the_adequacy_floor():
    records = (sine(100.0, 2e-5, 0.2, sigma=1e-12),)
    assert floors(records)[0] == ADEQUACY * stroke(records)
    assert stroke(records) == pytest.approx(2e-5, rel=1e-3)


def test_jumps_of_a_staircase_are_not_noise():
    levels = np.repeat([0.0, 2.0, 4.0, 6.0, 4.0, 2.0], 500)
    record = Record(levels, 4e-6 * levels + SIGMA * RANDOM.normal(size=levels.size), 1e-2)
    assert white_noise(record) == pytest.approx(SIGMA, rel=0.1)


def test_a_record_that_never_settles_takes_its_noise_from_the_others():
    quiet = [sine(f, 2e-5, 0.4) for f in (50.0, 250.0, 400.0)]
    modes = (230.0, 310.0, 380.0)  # one alone is a peak of the spectrum
    ringing = sine(
        200.0, 2e-5, 0.1, added=lambda t: 2e-5 * np.exp(-30 * t) * sum(np.cos(2 * np.pi * f * t) for f in modes)
    )
    assert period_scatter(ringing) > 5 * SIGMA
    assert noise_floors((*quiet, ringing))[-1] == pytest.approx(SIGMA, rel=1.1)


def test_jitter_of_the_clock_counts_in_every_record_by_its_speed():
    def jittery(frequency):
        t = 2e-5 * np.arange(20_000)
        late = t + 3e-6 * RANDOM.normal(size=t.size)
        u, y = (np.cos(2 * np.pi * frequency * x) for x in (t, late))
        return Record(u, 1e-5 * y + SIGMA * RANDOM.normal(size=t.size), 2e-5, phase="sine")

    records = tuple(jittery(f) for f in (50.0, 100.0, 250.0))
    expected = [np.hypot(SIGMA, 1e-5 * 2 * np.pi * f * 3e-6 / np.sqrt(2)) for f in (50.0, 100.0, 250.0)]
    assert noise_floors(records) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("seed", range(8))
def test_chance_in_a_slow_record_is_no_jitter_of_fast_ones(seed):
    """With a slow triangle as the only periodic record, the floor of a fast one was up to 27 times the noise."""
    rng = np.random.default_rng(seed)
    slow = 100 * np.abs(np.mod(np.arange(1200) / 400 + 0.5, 1.0) * 2 - 1)
    fast = 50 + scipy.ndimage.gaussian_filter1d(rng.normal(0, 100, 6000), 10)
    records = tuple(
        Record(drive, 1e-7 * drive + SIGMA * rng.normal(size=drive.size), period)
        for drive, period in ((slow, 2.5e-3), (fast, 1e-4))
    )
    assert noise_floors(records)[1] == pytest.approx(SIGMA, rel=0.2)


def ringing_stage(drive, frequency, damping, noise):
    """A stage with a play and one mode, sampled at 10 kHz; noise as a share of the range."""
    loop, last = np.empty(drive.size), drive[0]
    for i, u in enumerate(drive):
        loop[i] = last = min(max(last, u - 0.5), u + 0.5)
    moved, omega = 0.8 * drive + 0.2 * loop, 2.0 * np.pi * frequency
    mode = scipy.signal.cont2discrete(([omega**2], [1.0, 2.0 * damping * omega, omega**2]), 1e-4)
    y = moved[0] + scipy.signal.lfilter(mode[0].ravel(), mode[1], moved - moved[0])
    return Record(drive, y + noise * np.ptp(drive) * RANDOM.normal(size=drive.size), 1e-4)


TIME = 1e-4 * np.arange(2000)
FAST_DRIVES = {
    "step": np.where(TIME < 0.02, 1.0, 9.0),
    "levels": np.repeat(RANDOM.uniform(1.0, 9.0, 8), 250),
    "square": np.where(np.mod(20.0 * TIME, 1.0) < 0.5, 1.0, 9.0),
    "triangle": 1.0 + 8.0 * np.abs(np.mod(60.0 * TIME + 0.5, 1.0) * 2.0 - 1.0),
    "sine": 5.0 - 4.0 * np.cos(2.0 * np.pi * 60.0 * TIME),
}


@pytest.mark.parametrize("noise", [2e-4, 2e-5])
@pytest.mark.parametrize("damping", [0.01, 0.05])
@pytest.mark.parametrize("frequency", [200.0, 600.0, 2000.0])
@pytest.mark.parametrize("drive", FAST_DRIVES)
def test_ringing_in_a_short_fast_record_is_not_noise(drive, frequency, damping, noise):
    """It fills the spectrum of a short record: the floor of eight steps was up to 97 times the noise."""
    voltage = FAST_DRIVES[drive]
    found = [noise_floors([ringing_stage(voltage, frequency, damping, noise)])[0] for _ in range(5)]
    # windows of 3.2 ms that end before the next turn of a 60 Hz triangle hardly separate ringing at 2 kHz
    most = 1.5 if (drive, frequency) == ("triangle", 2000.0) else 1.3
    assert 0.9 < np.median(found) / (noise * np.ptp(voltage)) < most


def test_the_smallest_of_several_estimates_is_not_too_small():
    """A floor that is too low makes false names; each estimate of 2000 samples differs by 4 % by chance."""
    random = np.random.default_rng(0)
    found = [white_noise(Record(np.zeros(2000), random.normal(size=2000), 1e-4)) for _ in range(400)]
    assert np.median(found) > 0.98 and np.quantile(found, 0.1) > 0.92
