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

"""`Simulation`: a simulated plant with the limits and the slow path of a stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ...errors import StageError
from ...record import Record
from ..description import Description, Samples
from ..limiter import Limiter
from ..plant import Plant, PlantParameters, Reading

SHORTEST_PERIOD = 1e-6
"""Shortest sample period of a simulated stage [s]."""
LONGEST_PERIOD = 10e-3
"""Longest sample period of a simulated stage [s]."""


class Simulation:
    """Base of both kinds of simulated stage: a plant with limits, single set-points, and whole phases."""

    def __init__(
        self,
        parameters: PlantParameters | None,
        *,
        seed: int,
        sample_period: float,
        streaming: bool,
        longest_block: int | None = None,
    ) -> None:
        self.parameters = PlantParameters() if parameters is None else parameters
        e, sensor = self.parameters.electronics, self.parameters.sensor
        rest = min(max(0.0, e.voltage_min), e.voltage_max)
        self._description = Description(
            name=f"simulated {'streaming' if streaming else 'memory'} stage, seed {seed}",
            streaming=streaming,
            sample_period_min=SHORTEST_PERIOD,
            sample_period_max=LONGEST_PERIOD,
            voltage_min=e.voltage_min,
            voltage_max=e.voltage_max,
            safe_voltage=rest,
            longest_block=longest_block,
            amplifier_gain=e.amplifier_gain,
            displacement_min=-sensor.range,
            displacement_max=sensor.range - sensor.lsb,
        )
        self._limiter = Limiter(self._description)
        self._sample_period = self._description.check_sample_period(sample_period)
        Plant(self.parameters, self._sample_period).run(np.zeros(1))  # compiles the kernels before a clock runs
        self._plant = Plant(self.parameters, self._sample_period, seed, rest)
        self._voltage = rest
        self._closed = False

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], **options: Any) -> Self:
        """A stage whose parameters are the defaults changed by a mapping, see `PlantParameters.from_mapping`.

        `options` are the other arguments of the class.
        """
        return cls(PlantParameters.from_mapping(mapping), **options)

    @property
    def description(self) -> Description:
        """Limits and kind of the simulated device."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Present sample period [s]."""
        return self._sample_period

    @property
    def voltage(self) -> float:
        """Present drive voltage [V], as it was commanded; `read_voltage` gives that of the converter."""
        return self._voltage

    @property
    def time(self) -> float:
        """Simulated time since the stage was opened [s]; it passes only while samples are taken."""
        return self._plant.time

    def configure(self, sample_period: float) -> None:
        """Set another sample period [s]; the plant is then settled at the present voltage."""
        self._require_ready()
        period = self._description.check_sample_period(sample_period)
        if period != self._sample_period:
            self._plant.configure(period, self.voltage)
            self._sample_period = period

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Use these limits and this ramp rate [V/s] from now on; see `Limiter.restricted`."""
        self._limiter = Limiter(self._description).restricted(limits, ramp_rate)

    def set_voltage(self, voltage: float) -> None:
        """Go to one voltage [V] at the ramp rate and hold it; without a ramp rate this takes one sample."""
        self._require_ready()
        self._go(self._limiter.goal(voltage))

    def read_voltage(self) -> float:
        """The drive voltage that the converter applies [V]."""
        self._require_ready()
        return self._plant.voltage

    def read_displacement(self) -> float:
        """One reading [m] while the voltage is held; takes one sample period of simulated time."""
        return float(self._run(np.array([self.voltage])).displacement[0])

    def safe(self) -> None:
        """Go to the safe voltage at the ramp rate and hold it."""
        if not self._closed and self.voltage != self._description.safe_voltage:
            self._go(self._description.safe_voltage)

    def close(self) -> None:
        """Go to the safe voltage; every later call but `close` and `safe` raises StageError."""
        self.safe()
        self.leave()

    def leave(self) -> None:
        """Release the device without moving it; every later call but `close` and `safe` raises StageError."""
        self._closed = True

    def play(
        self,
        voltage: ArrayLike,
        phase: str = "record",
        *,
        initial_voltage: float | None = None,
        continues: bool = False,
        average: int = 1,
    ) -> Record:
        """Play a whole phase as fast as the machine can and return its record.

        Parameters
        ----------
        voltage : (n,) array_like
            Drive voltage at the sample period of the stage [V], of any length.
        phase : str
            Name of the phase.
        initial_voltage : float, optional
            Voltage at which the stage has settled before [V]; default the first voltage. Unused with `continues`.
        continues : bool
            True to continue from the present state of the stage.
        average : int
            Number of samples of the stage that are averaged to one recorded sample, for slow phases.

        Returns
        -------
        Record
            With the simulated time of its first sample.

        Raises
        ------
        StageError
            If the drive breaks a limit; nothing is played.
        """
        self._require_ready()
        start = self.voltage
        if not continues:
            start = float(np.ravel(voltage)[0]) if initial_voltage is None else float(initial_voltage)
        drive = self._check(voltage, start)
        if not continues:
            self._plant.settle(self._check([start], start)[0])
        settled, time_before = self._plant.voltage, self.time
        reading = self._apply(drive)
        record = Record(
            reading.voltage,
            reading.displacement,
            self._sample_period,
            phase,
            time_before,
            continues=continues,
            initial_voltage=settled,
            channels=reading.channels,
        )
        return record.decimate(average) if average > 1 else record

    def _require_ready(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")

    def _check(self, voltage: ArrayLike, start: float) -> Samples:
        return self._limiter.check(voltage, start, self._sample_period)

    def _go(self, voltage: float) -> None:
        for part in self._limiter.ramp(self.voltage, voltage, self._sample_period):
            self._apply(part)

    def _run(self, voltage: Samples) -> Reading:
        self._require_ready()
        return self._apply(self._check(voltage, self.voltage))

    def _apply(self, drive: Samples) -> Reading:
        self._voltage = float(drive[-1])
        return self._plant.run(drive)
