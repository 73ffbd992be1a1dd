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

"""`Tier`: phases that are played together before the next decision. `tiers` lists them, the short ones first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...effects import Creep, GainDrift
from ...identification.protocol import excitation
from ...identification.protocol.drive_limits import DriveLimits, Samples
from ...identification.protocol.protocol import CORNERED, Protocol, ProtocolPhase
from ...record import CONDITIONING

SLOW, SLOWEST = 1e-3, 1e-2
"""Sample periods at which slow phases are stored [s]."""
SLOW_FAMILIES = (Creep.family, GainDrift.family)
"""Families of effects that only long phases show."""
FAST_TIERS = 2
"""Number of tiers that contain every kind of fast drive; later tiers only add longer holds and repeats."""


@dataclass(frozen=True, eq=False, slots=True)
class Tier:
    """Phases that are played together.

    Parameters
    ----------
    name : str
        Short description.
    phases : tuple of ProtocolPhase
        Phases in the order in which they are played.
    """

    name: str
    phases: tuple[ProtocolPhase, ...]

    @property
    def duration(self) -> float:
        """Stage time [s]."""
        return sum(p.duration for p in self.phases)


class _Phases:
    """Collects phases inside the limits."""

    def __init__(self, limits: DriveLimits, seed: int) -> None:
        self.limits, self.seed, self.phases = limits, seed, list[ProtocolPhase]()

    def add(self, name: str, body: Samples, stored_period: float = 0.0) -> None:
        every = max(1, int(stored_period / self.limits.sample_period + 1e-9))
        self.phases.append(ProtocolPhase(name, self.limits.from_safe_to_safe(body), self.limits.sample_period, every))

    def noise(self, rms: float) -> None:
        self.seed += 1
        bandwidth = 0.2 / self.limits.sample_period
        self.add("noise", excitation.noise(self.limits, rms, bandwidth, 0.4, centre=0.35, seed=self.seed))

    def multisine(self, amplitude: float) -> None:
        self.seed += 1
        highest = min(2000.0, 0.2 / self.limits.sample_period)
        self.add(
            "multisine", excitation.multisine(self.limits, 20.0, highest, amplitude, 4, centre=0.5, seed=self.seed)
        )

    def triangle(self, peaks: Sequence[float], frequency: float = 1.0) -> None:
        self.add("triangle", excitation.triangle(self.limits, peaks, frequency), CORNERED)

    def sines(self, *frequencies: float) -> None:
        for frequency in frequencies:
            body = excitation.sine(self.limits, frequency, max(0.1, 2.0 / frequency))
            self.add(f"sine_{frequency:g}hz", body, SLOW if frequency <= 10.0 else 0.0)

    def staircase(self, levels: Sequence[float], hold: float) -> None:
        body = excitation.steps(self.limits, levels, hold, slew_rate=self.limits.ramp_rate)
        self.add("staircase", body, SLOWEST)

    def minor_loops(self, corners: Sequence[float]) -> None:
        self.add("minor_loops", excitation.ramps(self.limits, corners, 2.0 * self.limits.span), CORNERED)

    def rest(self, level: float, duration: float) -> None:
        self.add("rest", excitation.hold(self.limits, level, duration), SLOWEST)

    def taken(self) -> tuple[ProtocolPhase, ...]:
        phases, self.phases = tuple(self.phases), []
        return phases


def tiers(limits: DriveLimits, seed: int = 0) -> tuple[Tier, ...]:
    """All tiers, about 70 s of stage time on the default range.

    Parameters
    ----------
    limits : DriveLimits
        Sample period and limits; every sample of every phase stays inside them.
    seed : int
        Seed of the random waveforms.
    """
    made = _Phases(limits, seed)
    corners = (0.0, 1.0, 0.0, *excitation.decaying_loops(0.5, 0.7, 12))
    made.add(CONDITIONING, excitation.ramps(limits, corners, limits.ramp_rate), CORNERED)
    made.add("step", excitation.steps(limits, (0.2, 0.5, 0.8, 0.5) * 4, 0.01))
    for rms in (0.012, 0.012, 0.003):
        made.noise(rms)
    made.triangle((1.0, 0.5))
    made.sines(100.0, 300.0)
    for _ in range(2):
        made.multisine(0.3)
    made.triangle((0.75, 0.25))
    made.minor_loops(excitation.nested_loops(0.45, 5))
    first = Tier("loops and dynamics", made.taken())

    for _ in range(2):
        made.multisine(0.05)
    made.noise(0.003)
    made.add("steps", excitation.steps(limits, (0.05, 0.95) * 4, 0.005, slew_rate=2e3 * limits.span))
    made.add("step", excitation.steps(limits, (0.2, 0.5, 0.8, 0.5) * 4, 0.01))
    made.sines(50.0, 200.0, 400.0)
    made.staircase((0.0, 0.5, 1.0, 0.5, 0.0), 1.0)
    made.minor_loops(excitation.decaying_loops(0.5, 0.75, 12))
    second = Tier("small and fast drives, short holds", made.taken())

    made.sines(1.0)
    made.staircase((0.0, 0.33, 0.67, 1.0, 0.67, 0.33, 0.0), 2.0)
    made.rest(0.0, 2.0)
    made.triangle((1.0, 0.5))
    third = Tier("holds", made.taken())

    made.staircase((0.0, 0.5, 1.0, 0.5, 0.0), 4.0)
    made.rest(0.0, 3.0)
    made.triangle((1.0, 0.25))
    made.multisine(0.3)
    fourth = Tier("long holds, and repetitions of earlier phases", made.taken())
    return first, second, third, fourth


def spare_drives(limits: DriveLimits, seed: int = 0) -> tuple[ProtocolPhase, ...]:
    """Further drives to separate rivals: longer, faster or larger than those of the tiers."""
    made = _Phases(limits, seed + 1000)
    made.staircase((0.0, 0.8, 0.2), 10.0)
    made.add("staircase", excitation.hold(limits, 0.8, 40.0), SLOWEST)
    made.rest(0.0, 30.0)
    made.minor_loops(excitation.nested_loops(0.45, 8))
    made.triangle((1.0, 0.5), 0.2)
    made.triangle((0.5, 0.25), 5.0)
    made.sines(1.0, 10.0, 700.0)
    made.multisine(0.4)
    made.noise(0.03)
    return made.taken()


def whole_plan(limits: DriveLimits, seed: int = 0) -> Protocol:
    """All tiers as one protocol, which is played completely if no answer is certain before and no drive is chosen."""
    return Protocol("live diagnosis", limits, tuple(p for tier in tiers(limits, seed) for p in tier.phases))
