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

"""`ProtocolPhase` and `Protocol`: the waveforms that are played to a stage, their order, and how they are stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...errors import IdentificationError
from ...parameter import slew_text
from ...record import CONDITIONING
from . import excitation
from .drive_limits import DriveLimits, Samples

SINES = (1.0, 50.0, 100.0, 200.0, 300.0, 400.0)
"""Frequencies of the paper, Table 1 [Hz]."""

CORNERED = 1e-4
"""Longest stored sample period [s] of loops with sharp turning points, because averaging flattens them."""


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
            f"{self.phases} phases, {self.duration:.1f} s, {self.voltage_min:g} to {self.voltage_max:g} V, "
            f"largest slew {slew_text(self.largest_slew, 4)}, {self.stored_samples} samples stored"
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


class _Plan:
    """Collects phases made from the shapes of `excitation`."""

    def __init__(self, limits: DriveLimits, seed: int) -> None:
        self.limits, self.seed, self.phases = limits, seed, list[ProtocolPhase]()

    def add(self, name: str, body: Samples, stored_period: float = 0.0) -> None:
        """Append a phase with a stored sample period of at most `stored_period` [s]."""
        every = max(1, int(stored_period / self.limits.sample_period + 1e-9))
        self.phases.append(ProtocolPhase(name, self.limits.from_safe_to_safe(body), self.limits.sample_period, every))

    def next_seed(self) -> int:
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

    def noise(self, rms: float, duration: float) -> None:
        body = excitation.noise(
            self.limits, rms, 0.2 / self.limits.sample_period, duration, centre=0.35, seed=self.next_seed()
        )
        self.add("noise", body)

    def triangle(self, peaks: tuple[float, ...] = (1.0, 0.75, 0.5, 0.25)) -> None:
        self.add("triangle", excitation.triangle(self.limits, peaks, 1.0), CORNERED)

    def sines(self, frequencies: tuple[float, ...], slow_period: float) -> None:
        for frequency in frequencies:
            duration = max(0.1, 3.0 / frequency) if frequency > 10.0 else 2.0 / frequency
            body = excitation.sine(self.limits, frequency, duration)
            self.add(f"sine_{frequency:g}hz", body, slow_period if frequency <= 10.0 else 0.0)

    def multisine(self, amplitude: float, fundamental: float, highest: float, periods: int) -> None:
        body = excitation.multisine(
            self.limits, fundamental, highest, amplitude, periods, centre=0.5, seed=self.next_seed()
        )
        self.add("multisine", body)

    def validation(self, duration: float) -> None:
        self.add("validation", excitation.mixture(self.limits, duration, self.next_seed()))

    def protocol(self, name: str) -> Protocol:
        return Protocol(name, self.limits, tuple(self.phases))


def paper(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """The three published steps (paper, Sec. 3.2 to 3.4), the sines of Table 1 and a validation phase.

    Parameters
    ----------
    limits : DriveLimits, optional
        Clock and limits; the default is the range 0 to 10 V at 20 µs.
    seed : int
        Seed of the random waveforms.
    """
    plan = _Plan(limits or DriveLimits(), seed)
    plan.step(edges=32, duration=0.01)
    plan.noise(rms=0.012, duration=2.0)
    plan.triangle()
    plan.sines(SINES, slow_period=CORNERED)
    plan.validation(2.0)
    return plan.protocol("paper")


def short(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """All phases that an identification needs, about 25 s of stage time; parameters as in `paper`."""
    plan = _Plan(limits or DriveLimits(), seed)
    limits = plan.limits
    plan.conditioning()
    plan.add("rest", excitation.hold(limits, 0.0, 0.2))
    plan.step(edges=32, duration=0.01)
    plan.noise(rms=0.012, duration=0.8)
    plan.noise(rms=0.003, duration=0.4)
    plan.triangle()
    plan.sines(SINES, slow_period=CORNERED)
    plan.multisine(amplitude=0.2, fundamental=10.0, highest=2000.0, periods=4)
    plan.add("minor_loops", excitation.ramps(limits, excitation.nested_loops(0.45, 5), limits.ramp_rate / 2), CORNERED)
    plan.validation(1.0)
    plan.triangle((1.0,))
    return plan.protocol("short")


def rich(limits: DriveLimits | None = None, seed: int = 0) -> Protocol:
    """Long protocol that shows every effect of the catalogue, about 175 s; parameters as in `paper`."""
    plan = _Plan(limits or DriveLimits(), seed)
    limits = plan.limits
    slow, slowest = 1e-3, 1e-2
    span, ramp_rate = limits.span, limits.ramp_rate
    plan.conditioning()
    plan.add("rest", excitation.hold(limits, 0.0, 2.0), slow)
    plan.step(edges=32, duration=0.01)
    for rms in (0.012, 0.003):
        plan.noise(rms, duration=0.5)
        plan.noise(rms, duration=0.5)
    plan.triangle()
    plan.sines(SINES, slow_period=slow)
    for amplitude in (0.3, 0.05):
        for _ in range(2):
            plan.multisine(amplitude, fundamental=20.0, highest=2000.0, periods=4)
    plan.add("steps", excitation.steps(limits, (0.05, 0.95) * 4, 0.005, slew_rate=2e3 * span))
    plan.add("chirp", excitation.chirp(limits, (20.0, 3000.0), 0.5, centre=0.5, amplitude=0.1))
    staircase = (0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0)
    plan.add("staircase", excitation.steps(limits, staircase, 10.0, slew_rate=ramp_rate), slowest)
    plan.add("minor_loops", excitation.ramps(limits, excitation.nested_loops(0.45, 6), span), CORNERED)
    plan.add("minor_loops", excitation.ramps(limits, excitation.decaying_loops(0.5, 0.75, 12), span), CORNERED)
    plan.add("rest", excitation.hold(limits, 0.0, 10.0), slowest)
    plan.add("hold", excitation.hold(limits, 0.6, 20.0), slowest)
    plan.validation(2.0)
    plan.validation(2.0)
    plan.triangle()
    return plan.protocol("rich")
