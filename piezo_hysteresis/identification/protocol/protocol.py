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

"""`Protocol`: the phases that are played to a stage, in their order; and the three protocols of the package."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ...errors import IdentificationError, counted
from ...parameter import slew_text
from . import excitation
from .drive_limits import DriveLimits
from .phases import CORNERED, Phases, ProtocolPhase

SINES = (1.0, 50.0, 100.0, 200.0, 300.0, 400.0)
"""Frequencies of the paper, Table 1 [Hz]."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Summary of a protocol, available before the stage moves.

    Parameters
    ----------
    phases : int
        Number of phases.
    duration : float
        Stage time [s].
    voltage_min, voltage_max : float
        Range of the drive [V].
    largest_slew : float
        Steepest change between two samples [V/s].
    stored_samples : int
        Number of samples of the experiment.
    """

    phases: int
    duration: float
    voltage_min: float
    voltage_max: float
    largest_slew: float
    stored_samples: int

    def __str__(self) -> str:
        return (
            f"{counted(self.phases, 'phase')}, {self.duration:.1f} s, {self.voltage_min:g} to {self.voltage_max:g} V, "
            f"largest slew {slew_text(self.largest_slew, 4)}, {counted(self.stored_samples, 'sample')} stored"
        )


@dataclass(frozen=True, eq=False, slots=True)
class Protocol:
    """Phases in the order in which they are played.

    Raises
    ------
    IdentificationError
        If there is no phase, or one leaves the limits or does not start and end at the safe voltage.
    """

    name: str
    limits: DriveLimits
    phases: tuple[ProtocolPhase, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "phases", tuple(self.phases))
        if not self.phases:
            raise IdentificationError(f"protocol '{self.name}': got no phase, expected at least one")
        for phase in self.phases:
            self.limits.check(phase.voltage, f"phase '{phase.name}'")

    def __iter__(self) -> Iterator[ProtocolPhase]:
        return iter(self.phases)

    def __len__(self) -> int:
        return len(self.phases)

    @property
    def summary(self) -> Summary:
        """Duration, voltage range, largest slew and size."""
        return Summary(
            phases=len(self.phases),
            duration=sum(p.duration for p in self.phases),
            voltage_min=min(float(p.voltage.min()) for p in self.phases),
            voltage_max=max(float(p.voltage.max()) for p in self.phases),
            largest_slew=max(p.largest_slew for p in self.phases),
            stored_samples=sum(p.voltage.size // p.stored_every for p in self.phases),
        )


def paper(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """The three published steps (paper, Sec. 3.2 to 3.4), the sines of Table 1 and a validation phase.

    Parameters
    ----------
    limits : DriveLimits, optional
        Clock and limits; the default is the range 0 to 10 V at 20 µs.
    seed : int
        Seed of the random waveforms.
    """
    plan = Phases(limits or DriveLimits(), seed)
    plan.step(edges=32, duration=0.01)
    plan.noise(rms=0.012, duration=2.0)
    plan.triangle()
    plan.sines(*SINES, slow_period=CORNERED)
    plan.validation(2.0)
    return Protocol("paper", plan.limits, plan.taken())


def short(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """All phases that an identification needs, 18 s of stage time on the default range; parameters as in `paper`."""
    plan = Phases(limits or DriveLimits(), seed)
    plan.conditioning()
    plan.rest(0.0, 0.2)
    plan.step(edges=32, duration=0.01)
    plan.noise(rms=0.012, duration=0.8)
    plan.noise(rms=0.003, duration=0.4)
    plan.triangle()
    plan.sines(*SINES, slow_period=CORNERED)
    plan.multisine(amplitude=0.2, fundamental=10.0)
    plan.minor_loops(excitation.nested_loops(0.45, 5), plan.limits.ramp_rate / 2)
    plan.validation(1.0)
    plan.triangle((1.0,))
    return Protocol("short", plan.limits, plan.taken())


def rich(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """Long protocol that shows every effect of the catalogue, 159 s on the default range; parameters as in `paper`."""
    plan = Phases(limits or DriveLimits(), seed)
    limits = plan.limits
    slow, slowest = 1e-3, 1e-2
    plan.conditioning()
    plan.rest(0.0, 2.0, slow)
    plan.step(edges=32, duration=0.01)
    for rms in (0.012, 0.003):
        plan.noise(rms, duration=0.5)
        plan.noise(rms, duration=0.5)
    plan.triangle()
    plan.sines(*SINES, slow_period=slow)
    for amplitude in (0.3, 0.05):
        for _ in range(2):
            plan.multisine(amplitude)
    plan.steps()
    plan.add("chirp", excitation.chirp(limits, (20.0, 3000.0), 0.5, centre=0.5, amplitude=0.1))
    plan.staircase((0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0), 10.0, slowest)
    plan.minor_loops(excitation.nested_loops(0.45, 6), limits.span)
    plan.minor_loops(excitation.decaying_loops(0.5, 0.75, 12), limits.span)
    plan.rest(0.0, 10.0, slowest)
    plan.add("hold", excitation.hold(limits, 0.6, 20.0), slowest)
    plan.validation(2.0)
    plan.validation(2.0)
    plan.triangle()
    return Protocol("rich", limits, plan.taken())
