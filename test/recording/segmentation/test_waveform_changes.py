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

"""A drive without rests is cut where one waveform ends and another begins, and nowhere else."""

import numpy as np
import pytest
from scipy import signal

from piezo_hysteresis.recording.segmentation.phases import propose
from piezo_hysteresis.recording.segmentation.waveform_changes import waveform_changes

PERIOD = 1e-3
TIME = np.arange(6000) * PERIOD


def sine(frequency, amplitude=5.0):
    return amplitude * (1.0 - np.cos(2 * np.pi * frequency * TIME))


def centred(frequency):
    return 5.0 + 5.0 * np.sin(2 * np.pi * frequency * TIME)


def growing(frequency, levels, cycles, *, straight=False):
    phase = 2 * np.pi * np.arange(round(cycles / frequency / PERIOD)) * frequency * PERIOD
    wave = 2 / np.pi * np.arcsin(np.sin(phase)) if straight else np.sin(phase)
    return np.concatenate([5.0 + 5.0 * level * wave for level in levels])


def triangle(frequency, amplitude=8.0):
    return amplitude * (1.0 - np.abs(2.0 * ((frequency * TIME) % 1.0) - 1.0))


def noise(seed, *band):
    corners = 2 * PERIOD * np.array(band)
    shape = signal.butter(4, np.squeeze(corners), "band" if corners.size == 2 else "low", output="sos")
    x = signal.sosfilt(shape, np.random.default_rng(seed).normal(size=TIME.size))
    return 5.0 + 2.0 * x / np.std(x)


def chirp(first, last, method="linear"):
    return 5.0 - 5.0 * signal.chirp(TIME, first, TIME[-1], last, method)


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        ([sine(2), triangle(1), sine(10)], ["sine_2hz", "triangle", "sine_10hz"]),
        ([triangle(2), noise(1, 50.0), sine(5)], ["triangle", "noise", "sine_5hz"]),
        ([centred(1), centred(10), centred(30)], ["sine_1hz", "sine_10hz", "sine_30hz"]),
        ([triangle(1), triangle(10)], ["triangle", "triangle"]),
        ([sine(2), triangle(2), sine(2)], ["sine_2hz", "triangle", "sine_2hz"]),
        ([sine(2), chirp(1, 20), triangle(2)], ["sine_2hz", "chirp", "triangle"]),
    ],
)
@pytest.mark.parametrize("noise_level", [0.0, 0.003])
def test_consecutive_waveforms_are_separated(parts, names, noise_level):
    drive = np.concatenate(parts)
    drive = drive + noise_level * np.random.default_rng(2).normal(size=drive.size)
    found = propose(drive, PERIOD)
    assert [name for _, name in found] == names
    longest_swing = 0.5  # of the slowest waveform [s]
    for i, (start, _) in enumerate(found):
        assert abs(start - i * TIME.size) * PERIOD <= longest_swing


LEVELS = {
    "five levels": (0.2, 0.4, 0.6, 0.8, 1.0),
    "three levels": (0.3, 0.6, 1.0),
    "up and down": (0.2, 0.6, 1.0, 0.6, 0.2),
}


@pytest.mark.parametrize("levels", LEVELS.values(), ids=LEVELS.keys())
@pytest.mark.parametrize("cycles", [1, 2, 3])
@pytest.mark.parametrize("straight", [False, True], ids=["sines", "triangles"])
def test_growing_waves_of_three_rates_are_three_phases(levels, cycles, straight):
    parts = [growing(f, levels, cycles, straight=straight) for f in (0.5, 5.0, 31.25)]
    found = propose(np.concatenate((np.full(500, 5.0), *parts)), PERIOD)
    kinds = ["rest", *(["triangle"] * 3 if straight else ["sine"] * 3)]
    assert [name.split("_")[0] for _, name in found] == kinds
    starts = 500 + np.cumsum([0, *(part.size for part in parts[:-1])])
    longest_swing = np.array([1.0, 1.0, 0.1])  # [s]
    assert np.all(np.abs(np.array([start for start, _ in found[1:]]) - starts) * PERIOD <= longest_swing)


def multisine(seed, count):
    rng = np.random.default_rng(seed)
    lines = (np.cos(2 * np.pi * 0.5 * (k + 1) * TIME + rng.uniform(0, 2 * np.pi)) for k in range(count))
    return 5.0 + sum(lines)


def minor_loops(levels):
    return np.concatenate([np.linspace(a, b, int(abs(b - a) * 50)) for a, b in zip(levels, levels[1:], strict=False)])


SINGLE = {
    **{f"noise to {f} Hz, {seed}": noise(seed, f) for f in (3.0, 10.0, 60.0) for seed in range(6)},
    **{f"noise {a} to {b} Hz, {seed}": noise(seed, a, b) for a, b in ((4.0, 6.0), (9.0, 11.0)) for seed in range(8)},
    "slow chirp": chirp(0.5, 5),
    "logarithmic chirp": chirp(2, 60, "logarithmic"),
    "falling chirp": chirp(20, 1),
    **{f"{count} lines, {seed}": multisine(seed, count) for count in (2, 3, 6, 20) for seed in range(3)},
    "growing sine": 5.0 + (1.0 + TIME / 2.0) * np.sin(2 * np.pi * 5.0 * TIME),
    "beating": 5.0 + 2.0 * np.sin(2 * np.pi * 10.0 * TIME) + 2.0 * np.sin(2 * np.pi * 10.5 * TIME),
    "triangles of several amplitudes": np.concatenate([triangle(2, a)[:1500] for a in (10.0, 7.0, 4.0, 2.0)]),
    "minor loops": minor_loops([0, 8, 2, 7, 3, 6, 4, 5, 0]),
    "nested loops": minor_loops([0, 8, 7, 8, 7, 8, 7, 8, 4, 8, 4, 8, 4, 0]),
    "noisy sine": sine(3) + 0.05 * np.random.default_rng(3).normal(size=TIME.size),
}  # fmt: skip


@pytest.mark.parametrize("drive", SINGLE.values(), ids=SINGLE.keys())
def test_one_waveform_stays_in_one_piece(drive):
    assert waveform_changes(drive) == []


def test_a_constant_drive_has_no_waveforms():
    assert waveform_changes(np.zeros(100)) == []
