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

"""`ProtocolPhase` and `Phases`: one waveform of a protocol, and how phases are made inside the drive limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...record import CONDITIONING, Record
from . import excitation
from .drive_limits import DriveLimits, Samples

CORNERED = 1e-4
"""Longest stored sample period [s] of loops with sharp turning points, because averaging flattens them."""
FEWEST = 4
"""Smallest number of samples of a noise phase: one period of one line."""


@dataclass(frozen=True, eq=False, slots=True)
class ProtocolPhase:
    """One waveform of a protocol.

    Parameters
    ----------
    name : str
        Phase name, e.g. ``"triangle"``.
    voltage : (n,) array
        Drive at `sample_period`, from the safe voltage to the safe voltage [V].
    sample_period : float
        Period at which the drive is played [s].
    stored_every : int
        Number of samples averaged into one when the phase is stored (`Record.decimate`); 1 to keep the dynamics.
    """

    name: str
    voltage: Samples
    sample_period: float
    stored_every: int = 1

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.voltage.size * self.sample_period)

    @property
    def stored_period(self) -> float:
        """Sample period at which the phase is stored [s]."""
        return self.stored_every * self.sample_period

    @property
    def largest_slew(self) -> float:
        """Steepest change between two samples [V/s]."""
        return float(np.max(np.abs(np.diff(self.voltage)), initial=0.0)) / self.sample_period

    def as_record(self, start_time: float = 0.0) -> Record:
        """The drive as it will be stored, from rest at `start_time` [s]; its displacement is not known yet and 0."""
        zeros = np.zeros(self.voltage.size)
        record = Record(self.voltage, zeros, self.sample_period, self.name, start_time=start_time)
        return record.decimate(self.stored_every) if 1 < self.stored_every <= record.size else record


class Phases:
    """Collects phases made from the shapes of `excitation`.

    Parameters
    ----------
    limits : DriveLimits
        Sample period and limits; every sample of every phase stays inside them.
    seed : int
        Seed of the random waveforms; each gets its own.
    """

    def __init__(self, limits: DriveLimits, seed: int) -> None:
        self.limits, self.seed, self.phases = limits, seed, list[ProtocolPhase]()

    def add(self, name: str, body: Samples, stored_period: float = 0.0) -> None:
        """Append a phase with a stored sample period of at most `stored_period` [s]."""
        every = max(1, int(stored_period / self.limits.sample_period + 1e-9))
        self.phases.append(ProtocolPhase(name, self.limits.from_safe_to_safe(body), self.limits.sample_period, every))

    def next_seed(self) -> int:
        """Seed of the next random waveform."""
        self.seed += 1
        return self.seed

    def conditioning(self) -> None:
        """Two full strokes and decaying loops, which remove the influence of the past motion."""
        corners = (0.0, 1.0, 0.0, *excitation.decaying_loops(0.5, 0.7, 12))
        self.add(CONDITIONING, excitation.ramps(self.limits, corners, self.limits.ramp_rate), CORNERED)

    def step(self, edges: int, duration: float) -> None:
        """Edges of 0.3 of the range at several levels: large enough to see the onset, small enough for the stage."""
        levels = tuple((0.2, 0.5, 0.8, 0.5)[k % 4] for k in range(edges + 1))
        self.add("step", excitation.steps(self.limits, levels, duration))

    def steps(self) -> None:
        """Fast edges over most of the range, which show a slew limit."""
        body = excitation.steps(self.limits, (0.05, 0.95) * 4, 0.005, slew_rate=2e3 * self.limits.span)
        self.add("steps", body)

    def noise(self, rms: float, duration: float) -> None:
        """Band-limited noise of `rms` of the range; nothing if `duration` [s] has too few samples for one period."""
        if self.limits.samples(duration) < FEWEST:
            return
        bandwidth = excitation.HIGHEST / self.limits.sample_period
        seed = self.next_seed()
        self.add("noise", excitation.noise(self.limits, rms, bandwidth, duration, centre=0.35, seed=seed))

    def triangle(self, peaks: Sequence[float] = (1.0, 0.75, 0.5, 0.25), frequency: float = 1.0) -> None:
        """One period of every peak."""
        self.add("triangle", excitation.triangle(self.limits, peaks, frequency), CORNERED)

    def sines(self, *frequencies: float, slow_period: float) -> None:
        """One phase per frequency that the sample rate allows; up to 10 Hz it is stored at `slow_period` [s]."""
        for frequency in (f for f in frequencies if f * self.limits.sample_period <= excitation.HIGHEST_SINE):
            duration = max(0.1, 3.0 / frequency) if frequency > 10.0 else 2.0 / frequency
            body = excitation.sine(self.limits, frequency, duration)
            self.add(f"sine_{frequency:g}hz", body, slow_period if frequency <= 10.0 else 0.0)

    def multisine(self, amplitude: float, fundamental: float = 20.0, highest: float = 2000.0) -> None:
        """Four periods of an odd multisine; both frequencies fall where the sample rate demands it."""
        fundamental, highest = excitation.possible_band(self.limits, (fundamental, highest), excitation.HIGHEST)
        seed = self.next_seed()
        self.add("multisine", excitation.multisine(self.limits, fundamental, highest, amplitude, 4, 0.5, seed))

    def staircase(self, levels: Sequence[float], hold: float, stored_period: float) -> None:
        """Levels one after the other, each held for `hold` [s]."""
        body = excitation.steps(self.limits, levels, hold, slew_rate=self.limits.ramp_rate)
        self.add("staircase", body, stored_period)

    def minor_loops(self, corners: Sequence[float], slew_rate: float) -> None:
        """Straight lines through the corners at `slew_rate` [V/s]."""
        self.add("minor_loops", excitation.ramps(self.limits, corners, slew_rate), CORNERED)

    def rest(self, level: float, duration: float, stored_period: float = 0.0) -> None:
        """One level for `duration` [s]."""
        self.add("rest", excitation.hold(self.limits, level, duration), stored_period)

    def validation(self, duration: float) -> None:
        """A mixture of all kinds of drive, for validation."""
        self.add("validation", excitation.mixture(self.limits, duration, self.next_seed()))

    def taken(self) -> tuple[ProtocolPhase, ...]:
        """The phases so far; the collection is empty after that."""
        phases, self.phases = tuple(self.phases), []
        return phases
