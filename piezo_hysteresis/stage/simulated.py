"""Simulated stages of both kinds: `SimulatedStage` streams, `SimulatedMemoryStage` plays from its own memory."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import StageError
from ..record import Record
from .plant import Plant, PlantParameters, Reading
from .stage import Acquired, Description, Samples

_SHORTEST_PERIOD = 1e-6
_LONGEST_PERIOD = 10e-3


class _Simulation:
    """What both kinds share: a plant behind limits, the slow path, and whole phases played from rest."""

    _streaming: bool
    _longest_block: int | None = None

    def __init__(
        self, parameters: PlantParameters | None = None, *, seed: int = 0, sample_period: float = 20e-6
    ) -> None:
        self.parameters = PlantParameters() if parameters is None else parameters
        e, sensor = self.parameters.electronics, self.parameters.sensor
        rest = min(max(0.0, e.voltage_min), e.voltage_max)
        self._description = Description(
            name=f"simulated {'streaming' if self._streaming else 'memory'} stage, seed {seed}",
            streaming=self._streaming,
            sample_period_min=_SHORTEST_PERIOD,
            sample_period_max=_LONGEST_PERIOD,
            voltage_min=e.voltage_min,
            voltage_max=e.voltage_max,
            safe_voltage=rest,
            longest_block=self._longest_block,
            amplifier_gain=e.amplifier_gain,
            displacement_min=-sensor.range,
            displacement_max=sensor.range - sensor.lsb,
        )
        self._sample_period = self._description.check_sample_period(sample_period)
        self._plant = Plant(self.parameters, self._sample_period, seed, rest)
        self._closed = False

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], *, seed: int = 0, sample_period: float = 20e-6) -> Self:
        """A stage whose parameters are the defaults changed by a mapping, see `PlantParameters.from_mapping`."""
        return cls(PlantParameters.from_mapping(mapping), seed=seed, sample_period=sample_period)

    @property
    def description(self) -> Description:
        """Limits and kind of the simulated device."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Sample period in force [s]."""
        return self._sample_period

    @property
    def voltage(self) -> float:
        """Drive voltage in force [V]."""
        return self._plant.voltage

    @property
    def time(self) -> float:
        """Simulated time since the stage was opened [s]; it passes only while samples are taken."""
        return self._plant.time

    def configure(self, sample_period: float) -> None:
        """Sample at another period [s]; the plant is taken as settled at the voltage in force."""
        self._require_open()
        period = self._description.check_sample_period(sample_period)
        if period != self._sample_period:
            self._plant.configure(period, self.voltage)
            self._sample_period = period

    def set_voltage(self, voltage: float) -> None:
        """Apply one voltage [V] and hold it; takes one sample period of simulated time."""
        self._run(np.array([voltage], dtype=np.float64))

    def read_displacement(self) -> float:
        """One reading [m] while the voltage is held; takes one sample period of simulated time."""
        return float(self._run(np.array([self.voltage])).displacement[0])

    def safe(self) -> None:
        """Apply the safe voltage and hold it."""
        if not self._closed and self.voltage != self._description.safe_voltage:
            self.set_voltage(self._description.safe_voltage)

    def close(self) -> None:
        """Make safe; every later call but `close` and `safe` raises StageError."""
        self.safe()
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
            Voltage at which the stage has settled before [V]; default the first voltage.
        continues : bool
            True to go on from the state the stage is in.
        average : int
            Slow phases: simulated at the sample period of the stage, then averaged over blocks of so many samples.

        Returns
        -------
        Record
            With the simulated time of its first sample.

        Raises
        ------
        StageError
            If the drive breaks a limit; nothing is played.
        """
        self._require_open()
        start = self.voltage
        if not continues:
            start = float(np.ravel(voltage)[0]) if initial_voltage is None else float(initial_voltage)
        drive = self._check(voltage, start)
        if not continues:
            self._plant.settle(self._check([start], start)[0])
        settled, time_before = self.voltage, self.time
        reading = self._plant.run(drive)
        record = Record(
            reading.voltage,
            reading.displacement,
            self._sample_period,
            phase,
            time_before,
            continues=continues,
            initial_voltage=settled,
            other_displacement=reading.other_displacement,
            temperature=reading.temperature,
        )
        return record.decimate(average) if average > 1 else record

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")

    def _check(self, voltage: ArrayLike, start: float) -> Samples:
        return self._description.check_voltage(voltage, start, self._sample_period)

    def _run(self, voltage: Samples) -> Reading:
        self._require_open()
        return self._plant.run(self._check(voltage, self.voltage))


class SimulatedStage(_Simulation):
    """A simulated stage that streams.

    Simulated time passes only while samples are taken; who wants real time paces the blocks.

    Parameters
    ----------
    parameters : PlantParameters, optional
        Physics; default the stage of the paper with nothing hidden.
    seed : int
        Fixes the noise and every random phase.
    sample_period : float
        Time between samples [s], 1 µs to 10 ms.

    Examples
    --------
    >>> stage = SimulatedStage(seed=1)
    >>> record = stage.play([0.0] * 100 + [3.0] * 100, phase="step")
    >>> record.size, record.phase
    (200, 'step')
    """

    _streaming = True

    def exchange(self, voltage: Samples) -> Acquired:
        """Apply a block of drive voltages [V] and return what was applied and measured, sample by sample."""
        return Acquired(*self._run(voltage))


class SimulatedMemoryStage(_Simulation):
    """A simulated stage with on-board memory: upload, arm, start, wait, read.

    Between two waveforms the plant holds its voltage and lives on for `dead_time`.

    Parameters
    ----------
    parameters, seed, sample_period
        As for `SimulatedStage`.
    longest_block : int
        Samples that the memory holds.
    dead_time : float
        Simulated time that arming takes [s].
    real_time_factor : float
        Speed at which a waveform plays: 1 is real time; infinite as fast as the machine can.
    """

    _streaming = False

    def __init__(
        self,
        parameters: PlantParameters | None = None,
        *,
        seed: int = 0,
        sample_period: float = 20e-6,
        longest_block: int = 32768,
        dead_time: float = 0.05,
        real_time_factor: float = math.inf,
    ) -> None:
        if not (longest_block >= 1 and dead_time >= 0 and real_time_factor > 0):
            raise StageError(
                f"memory stage: got longest_block {longest_block}, dead_time {dead_time:g} s, real_time_factor "
                f"{real_time_factor:g}, expected at least 1 sample, no negative time and a positive factor"
            )
        self._longest_block = longest_block
        super().__init__(parameters, seed=seed, sample_period=sample_period)
        self._dead_time, self._factor = dead_time, real_time_factor
        self._waveform: Samples | None = None
        self._acquired: Acquired | None = None
        self._armed = False
        self._end = 0.0

    def upload(self, voltage: Samples) -> None:
        """Store a waveform [V]."""
        self._require_idle()
        self._waveform = self._check(voltage, self.voltage).copy()
        self._armed = False

    def arm(self) -> None:
        """Make ready to start; takes `dead_time` of simulated time at the voltage in force."""
        self._require_idle()
        if self._waveform is None:
            raise StageError(f"{self._description.name}: armed without a waveform, expected upload() first")
        self._check(self._waveform, self.voltage)
        idle = round(self._dead_time / self._sample_period)
        if idle:
            self._plant.run(np.full(idle, self.voltage))
        self._acquired, self._armed = None, True

    def start(self) -> None:
        """Play and record the waveform."""
        self._require_open()
        if not self._armed or self._waveform is None:
            raise StageError(f"{self._description.name}: started without being armed, expected arm() first")
        self._armed = False
        self._end = time.monotonic() + self._waveform.size * self._sample_period / self._factor
        self._acquired = Acquired(*self._plant.run(self._waveform))

    def wait(self, timeout: float) -> None:
        """Return when the waveform has been played; StageError after `timeout` [s]."""
        self._require_open()
        if self._acquired is None:
            raise StageError(f"{self._description.name}: nothing to wait for, expected start() first")
        left = self._end - time.monotonic()
        time.sleep(min(max(left, 0.0), max(timeout, 0.0)))
        if left > timeout:
            raise StageError(
                f"{self._description.name}: still playing after {timeout:g} s, expected {left:.3g} s; wait again"
            )

    def read(self) -> Acquired:
        """The record of the waveform that was played."""
        self._require_idle()
        if self._acquired is None:
            raise StageError(f"{self._description.name}: nothing recorded, expected upload, arm, start, wait first")
        return self._acquired

    def configure(self, sample_period: float) -> None:
        """Sample at another period [s]; a waveform in memory is forgotten."""
        self._require_idle()
        super().configure(sample_period)
        self._waveform, self._acquired, self._armed = None, None, False

    def safe(self) -> None:
        """Stop what plays and apply the safe voltage."""
        self._end, self._armed = 0.0, False
        super().safe()

    def _require_idle(self) -> None:
        self._require_open()
        if time.monotonic() < self._end:
            raise StageError(f"{self._description.name}: is still playing, expected wait() first")
