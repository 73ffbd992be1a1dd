"""`DaqmxStage`: a stage on a National Instruments card, streamed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ...errors import DeviceError, StageError
from ..agreement import Agreement
from ..stage import Acquired, Description, Samples
from .setup import DaqmxSetup
from .tasks import DaqmxError, Tasks

_RAMP_STEP = 0.01
"""Time between two voltages of a ramp [s]."""
_CLIPPED = 0.998
"""Share of the range of the sensor from which on it counts as clipped."""


class DaqmxStage:
    """A streaming stage: output and input on one hardware clock, without regeneration.

    A block that is given waits in the output buffer for `Description.latency` samples; what `exchange` returns is what
    was applied and measured meanwhile, sample by sample. Blocks that come too late end the stream with an error.

    Parameters
    ----------
    setup : DaqmxSetup

    Raises
    ------
    StageError
        If NI-DAQmx, the server or the card is not there.
    """

    def __init__(self, setup: DaqmxSetup) -> None:
        self._setup, self._tasks, self._closed, self._is_lost = setup, Tasks(setup), False, False
        s = setup
        scale = abs(s.sensor_gain) * s.sensor_range
        self._description = Description(
            name=f"NI-DAQmx {s.server or 'local'} {s.device}/{s.output}",
            streaming=True,
            sample_period_min=s.sample_period_min,
            sample_period_max=1.0,
            voltage_min=s.voltage_min,
            voltage_max=s.voltage_max,
            max_slew_rate=s.max_slew_rate,
            safe_voltage=min(max(s.safe_voltage, s.voltage_min), s.voltage_max),
            amplifier_gain=s.amplifier_gain,
            displacement_min=-scale,
            displacement_max=scale,
            measured_voltage=bool(s.voltage_input),
            latency=s.lead,
        )
        self._sample_period = self._description.check_sample_period(s.sample_period)
        self._voltage = self._description.safe_voltage
        self._waiting: Samples = np.empty(0)
        self._readings: Samples = np.empty(0)
        self._agreement = self._new_agreement()
        try:
            self._voltage = self._found(self._tasks.read_once())
        except StageError:
            self._tasks.close()
            raise

    @property
    def description(self) -> Description:
        """Limits and scales as the setup says; `latency` is that of the output buffer."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Sample period in force [s]."""
        return self._sample_period

    @property
    def voltage(self) -> float:
        """Drive voltage given last [V]; on opening the one measured, or the safe one where there is no monitor."""
        return self._voltage

    def configure(self, sample_period: float) -> None:
        """Sample every so many seconds [s]; a stream ends where it is, at its last voltage."""
        self._require_open()
        period = self._description.check_sample_period(sample_period)
        if period != self._sample_period:
            with self._guarded():
                self._drain()
            self._sample_period = period

    def exchange(self, voltage: Samples) -> Acquired:
        """Give a block of drive voltages [V]; returns as many samples, applied and measured `latency` earlier."""
        self._require_open()
        drive = self._description.check_voltage(voltage, self._voltage, self._sample_period)
        with self._guarded():
            return self._stream(drive)

    def set_voltage(self, voltage: float) -> None:
        """Apply one voltage [V] and hold it; ends a stream."""
        self._require_open()
        drive = self._description.check_voltage(np.array([voltage]), self._voltage, self._sample_period)
        with self._guarded():
            self._drain()
            self._move(float(drive[0]))

    def read_displacement(self) -> float:
        """One reading of the sensor [m]; ends a stream."""
        self._require_open()
        with self._guarded():
            self._drain()
            return float(self._tasks.read_once()[0]) * self._setup.sensor_gain

    def read_voltage(self) -> float:
        """One reading of the drive voltage at the monitor [V], else the one given last; ends a stream."""
        self._require_open()
        with self._guarded():
            self._drain()
            readings = self._tasks.read_once()
            return float(self._measured(readings)) if self._setup.voltage_input else self._voltage

    def safe(self) -> None:
        """Let what is in the buffer play to its end, go to the safe voltage, and end the stream."""
        if self._closed:
            return
        try:
            self._retreat()
        except DaqmxError as error:
            raise StageError(f"{error}; {self._unknown()}") from None

    def close(self) -> None:
        """Make safe and release the card; every later call but `close` and `safe` raises StageError."""
        try:
            self.safe()
        finally:
            if not self._closed:
                self._closed = True
                self._tasks.close()

    @property
    def _lead(self) -> int:
        return max(round(self._setup.lead / self._sample_period), 1)

    def _stream(self, drive: Samples) -> Acquired:
        if not self._tasks.is_running:
            delayed = self._lead + round(self._setup.io_delay / self._sample_period)
            self._waiting = np.full(delayed, self._voltage)
            self._tasks.start(self._sample_period, np.full(self._lead, self._voltage))
            self._agreement, self._readings = self._new_agreement(), np.empty(0)
        self._tasks.write(drive)
        self._voltage = float(drive[-1])
        self._waiting = np.concatenate((self._waiting, drive))
        applied, self._waiting = self._waiting[: drive.size], self._waiting[drive.size :]
        readings, before = self._tasks.read(drive.size), self._readings
        if np.array_equal(readings, before) and np.ptp(readings[0]) > 0:
            raise DaqmxError(f"{self._description.name}: got the same {drive.size} samples twice; samples were lost")
        self._readings = readings
        measured = self._measured(readings) if self._setup.voltage_input else applied
        displacement = readings[0] * self._setup.sensor_gain
        self._agreement.check(applied, measured, displacement)
        return Acquired(measured, displacement)

    def _measured(self, readings: Samples) -> Samples:
        """Drive voltage from the monitor [V]."""
        return np.asarray(readings[1] / (self._setup.monitor_gain * self._setup.amplifier_gain))

    def _found(self, readings: Samples) -> float:
        """Drive voltage at which the card stands before anything was given [V]."""
        safe = self._description.safe_voltage
        if not self._setup.voltage_input:
            return safe
        measured = float(self._measured(readings))
        if abs(measured - safe) * abs(self._setup.amplifier_gain) <= self._setup.voltage_tolerance:
            return safe
        return min(max(measured, self._description.voltage_min), self._description.voltage_max)

    def _new_agreement(self) -> Agreement:
        s, d = self._setup, self._description
        settling = int(np.ceil(s.settling_time / self._sample_period))
        inside = _CLIPPED * d.displacement_max
        return Agreement(s.voltage_tolerance / abs(s.amplifier_gain), settling, -inside, inside)

    def _drain(self) -> None:
        """End the stream when its last voltage is out."""
        if self._tasks.is_running:
            self._stream(np.full(self._lead, self._voltage))
            self._tasks.stop()

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Go to the safe voltage when the card fails, and say in the error whether it was reached."""
        try:
            yield
        except DeviceError as error:
            try:
                self._abort()
                end = f"the output was set to its safe voltage, {self._voltage:g} V"
            except DaqmxError:
                end = self._unknown()
            raise StageError(f"{error}; {end}") from None

    def _retreat(self) -> None:
        if self._is_lost:
            self._abort()
        elif self._tasks.is_running:
            try:
                goal, step = self._description.safe_voltage, self._setup.max_slew_rate * self._sample_period
                count = max(int(np.ceil(abs(goal - self._voltage) / step)), 1)
                self._stream(np.linspace(self._voltage, goal, count + 1)[1:])
                self._drain()
            except DeviceError:
                self._abort()
        elif self._voltage != self._description.safe_voltage:
            self._ramp()

    def _abort(self) -> None:
        """End a stream that has failed, and go to the safe voltage from where the output stands, if that is known."""
        self._tasks.abandon()
        if self._setup.voltage_input:
            self._voltage = self._found(self._tasks.read_once())
        elif self._waiting.size:
            self._voltage = float(self._waiting[0])
        self._ramp()

    def _ramp(self) -> None:
        goal, step = self._description.safe_voltage, self._setup.max_slew_rate * _RAMP_STEP
        while abs(goal - self._voltage) > step:
            self._move(self._voltage + float(np.copysign(step, goal - self._voltage)))
            time.sleep(_RAMP_STEP)
        self._move(goal)

    def _move(self, drive: float) -> None:
        self._tasks.write_once(drive)
        self._voltage, self._is_lost = drive, False

    def _unknown(self) -> str:
        self._is_lost = True
        return (
            f"the voltage of the stage is unknown, last given {self._voltage:g} V; switch the amplifier off "
            "by hand: the card holds its output"
        )

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")
