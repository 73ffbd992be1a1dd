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

from dataclasses import dataclass

from ...effects import Creep, GainDrift
from ...identification.protocol import excitation
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import Phases, ProtocolPhase
from ...identification.protocol.protocol import Protocol

SLOW, SLOWEST = 1e-3, 1e-2
"""Sample periods at which slow phases are stored [s]."""
SHORT = 0.4
"""Length of a noise phase [s]."""
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


def tiers(limits: DriveLimits, seed: int = 0) -> tuple[Tier, ...]:
    """All tiers, about 70 s of stage time on the default range.

    Parameters
    ----------
    limits : DriveLimits
        Sample period and limits; every sample of every phase stays inside them.
    seed : int
        Seed of the random waveforms.
    """
    made = Phases(limits, seed)
    fast_loops = 2.0 * limits.span
    made.conditioning()
    made.step(edges=15, duration=0.01)
    for rms in (0.012, 0.012, 0.003):
        made.noise(rms, SHORT)
    made.triangle((1.0, 0.5))
    made.sines(100.0, 300.0, slow_period=SLOW)
    for _ in range(2):
        made.multisine(0.3)
    made.triangle((0.75, 0.25))
    made.minor_loops(excitation.nested_loops(0.45, 5), fast_loops)
    first = Tier("loops and dynamics", made.taken())

    for _ in range(2):
        made.multisine(0.05)
    made.noise(0.003, SHORT)
    made.steps()
    made.step(edges=15, duration=0.01)
    made.sines(50.0, 200.0, 400.0, slow_period=SLOW)
    made.staircase((0.0, 0.5, 1.0, 0.5, 0.0), 1.0, SLOWEST)
    made.minor_loops(excitation.decaying_loops(0.5, 0.75, 12), fast_loops)
    second = Tier("small and fast drives, short holds", made.taken())

    made.sines(1.0, slow_period=SLOW)
    made.staircase((0.0, 0.33, 0.67, 1.0, 0.67, 0.33, 0.0), 2.0, SLOWEST)
    made.rest(0.0, 2.0, SLOWEST)
    made.triangle((1.0, 0.5))
    third = Tier("holds", made.taken())

    made.staircase((0.0, 0.5, 1.0, 0.5, 0.0), 4.0, SLOWEST)
    made.rest(0.0, 3.0, SLOWEST)
    made.triangle((1.0, 0.25))
    made.multisine(0.3)
    fourth = Tier("long holds, and repetitions of earlier phases", made.taken())
    return first, second, third, fourth


def spare_drives(limits: DriveLimits, seed: int = 0) -> tuple[ProtocolPhase, ...]:
    """Further drives to separate rivals: longer, faster or larger than those of the tiers."""
    made = Phases(limits, seed + 1000)
    made.staircase((0.0, 0.8, 0.2), 10.0, SLOWEST)
    made.staircase((0.8,), 40.0, SLOWEST)
    made.rest(0.0, 30.0, SLOWEST)
    made.minor_loops(excitation.nested_loops(0.45, 8), 2.0 * limits.span)
    made.triangle((1.0, 0.5), 0.2)
    made.triangle((0.5, 0.25), 5.0)
    made.sines(1.0, 10.0, 700.0, slow_period=SLOW)
    made.multisine(0.4)
    made.noise(0.03, SHORT)
    return made.taken()


def whole_plan(limits: DriveLimits, seed: int = 0) -> Protocol:
    """All tiers as one protocol, which is played completely if no answer is certain before and no drive is chosen."""
    return Protocol("live diagnosis", limits, tuple(p for tier in tiers(limits, seed) for p in tier.phases))
