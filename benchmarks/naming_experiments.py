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

"""Experiments of the naming benchmark: the rich protocol of slow and fast phases, and the paper's poor one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.independent_plant import NATIVE
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

FULL = 10.0
"""The waveforms below are drawn for a stage of 10 V."""


class Player(Protocol):
    """A function that plays a phase from rest and returns its record."""

    volt: float

    def play(
        self,
        drive: np.ndarray,
        period: float,
        phase: str,
        rng: np.random.Generator,
        start_time: float = 0.0,
        averaged: int = 1,
    ) -> Record: ...


class PackagedPlant:
    """The simulated stage of the package as a `Player`; its clock is its own."""

    def __init__(self, parameters: PlantParameters, seed: int) -> None:
        self.stage = SimulatedStage(parameters, seed=seed)
        self.volt = FULL

    def play(self, drive, period, phase, rng, start_time=0.0, averaged=1):
        """See `Player`."""
        self.stage.configure(period)
        return self.stage.play(drive, phase, average=averaged)


@dataclass(frozen=True)
class ProtocolVariant:
    """Habits of a laboratory.

    Parameters
    ----------
    shift : float
        Added to every drive [V of 10]: −4 makes it bipolar.
    slowest : float
        Period at which the staircase is stored [s].
    hold : float
        Length of its steps [s].
    with_steps : bool
        Whether there are step phases.
    """

    shift: float = 0.0
    slowest: float = 1e-2
    hold: float = 5.0
    with_steps: bool = True


def triangle(peaks, dt, frequency=1.0):
    """Triangles of one period each, from 0 to every peak [V]."""
    corners = [0.0]
    for peak in peaks:
        corners += [peak, 0.0]
    times = np.arange(len(corners)) / (2 * frequency)
    return np.interp(np.arange(0, times[-1], dt), times, corners)


def noise(rms, duration, rng):
    """Band-limited noise up to 8 kHz around 3.5 V."""
    n = int(duration / NATIVE)
    spectrum = rng.normal(size=n // 2 + 1) + 1j * rng.normal(size=n // 2 + 1)
    spectrum[np.fft.rfftfreq(n, NATIVE) > 8e3] = 0
    x = np.fft.irfft(spectrum, n)
    return 3.5 + rms * x / x.std()


def multisine(rms, rng, fundamental=20.0, top=1500.0, periods=3):
    """Odd multisine with random phases around 3.5 V, inside 0 to 7 V."""
    t = np.arange(0, periods / fundamental, NATIVE)
    x = sum(np.cos(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f in np.arange(fundamental, top, 2 * fundamental))
    return 3.5 + x * min(rms / x.std(), 3.4 / np.abs(x).max())


def ladder(levels, hold, rate, dt):
    """Levels held for a time [s], ramps between them at `rate` [V/s]."""
    times, values = [0.0], [levels[0]]
    for before, after in zip(levels, levels[1:], strict=False):
        times += [times[-1] + hold, times[-1] + hold + abs(after - before) / rate]
        values += [before, after]
    times.append(times[-1] + hold)
    values.append(values[-1])
    return np.interp(np.arange(0, times[-1], dt), times, values)


def corners(levels, dt, duration=4.0):
    """Straight lines between turning points."""
    return np.interp(np.arange(0, duration, dt), np.linspace(0, duration, len(levels)), levels)


def rich(plant: Player, seed: int, layout: ProtocolVariant | None = None) -> Experiment:
    """Step, noise at two levels, triangles, sines, multisines, trapezoids, staircase, minor loops, rests, triangle."""
    layout = layout or ProtocolVariant()
    rng = np.random.default_rng(seed)
    records: list[Record] = []
    clock = 0.0

    def add(phase, drive, period=NATIVE, averaged=1):
        nonlocal clock
        volts = (drive + layout.shift) * plant.volt / FULL
        records.append(plant.play(volts, period, phase, rng, clock, averaged))
        clock += drive.size * period + 0.5

    add("rest", np.zeros(2000), 1e-3)
    if layout.with_steps:
        for _ in range(2):
            add("step", np.repeat([1.0, 4.0, 1.0, 4.0], 500))
    for rms in (0.12, 0.12, 0.03, 0.03):
        add("noise", noise(rms, 0.25, rng))
    add("triangle", triangle((8, 6, 4, 2), 1e-4), 1e-4, 10)
    add("sine_1hz", 3.5 + 2.5 * np.sin(2 * np.pi * np.arange(0, 2, 1e-4)), 1e-4, 10)
    for f in (50, 100, 200, 300, 400):
        add(f"sine_{f}hz", 3.5 + 2.5 * np.sin(2 * np.pi * f * np.arange(0, max(3, f // 20) / f, NATIVE)))
    for rms in (1.0, 1.0, 0.2, 0.2):
        add("multisine", multisine(rms, rng))
    add("trapezoid", ladder((1, 7, 1, 7, 1), 0.004, 4e4, NATIVE))
    add("trapezoid", ladder((0.5, 4, 1, 8, 2), 0.004, 2e4, NATIVE))
    staircase = ladder((0, 2, 4, 6, 8, 6, 4, 2, 0), layout.hold, 40.0, 1e-3)
    add("staircase", staircase, 1e-3, round(layout.slowest / 1e-3))
    add("minor_loops", triangle((8, 2), 1e-4), 1e-4, 10)
    add("minor_loops", corners([0, 8, 2, 6, 3, 5, 3.5, 6, 2, 8, 0], 1e-4), 1e-4, 10)
    add("minor_loops", corners([0, 8, 1, 7, 2, 6, 3, 5, 3.5, 4.5, 4], 1e-4), 1e-4, 10)
    add("rest", np.zeros(2000), 1e-3)
    add("rest", np.full(2000, 6.0), 1e-3)
    add("triangle", triangle((8, 6, 4, 2), 1e-4), 1e-4, 10)
    return Experiment(tuple(records), source="naming benchmark, rich protocol")


def poor(plant: Player, seed: int) -> Experiment:
    """The phases of the paper: a step, noise, a triangle, and sines."""
    kept, seen = [], set[str]()
    for record in rich(plant, seed):
        if record.phase.split("_")[0] in ("step", "noise", "triangle", "sine") and record.phase not in seen:
            seen.add(record.phase)
            kept.append(record)
    return Experiment(tuple(kept), source="naming benchmark, the paper's protocol")
