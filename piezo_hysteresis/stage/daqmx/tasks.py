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

"""`Tasks`: the output and the input task of a card, running on one clock. Nothing else calls NI-DAQmx."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any

import numpy as np

from ...errors import StageError
from ..description import Samples
from .daqmx_error import DaqmxError, EmptyBufferError, UnsupportedError, reported
from .link import Link
from .setup import DaqmxSetup

_RATE_TOLERANCE = 1e-4
"""Relative difference up to which the rate of the card counts as the requested one."""


class Tasks:
    """Tasks on a card, through the local driver or a gRPC device server.

    Parameters
    ----------
    setup : DaqmxSetup

    Attributes
    ----------
    last_written : float or None
        Voltage [V] at which the output stands when it has put out everything that was written; None where a fault
        makes this uncertain. It is set from outside where the output is found.

    Raises
    ------
    StageError
        If the package ``nidaqmx`` is not installed.
    """

    def __init__(self, setup: DaqmxSetup) -> None:
        try:
            import nidaqmx
            import nidaqmx.stream_readers
            import nidaqmx.stream_writers
        except ImportError:
            raise StageError(
                "NI-DAQmx: the package nidaqmx is not installed; install it with pip install 'nidaqmx[grpc]'"
            ) from None
        self._setup, self._nidaqmx = setup, nidaqmx
        self._link = Link(setup, nidaqmx)
        self._output: Any = None
        self._input: Any = None
        self._writer: Any = None
        self._reader: Any = None
        self._sample_period = setup.sample_period
        self._queued = 0.0  # duration of the output in the buffer [s]
        self.last_written: float | None = None
        self._lowest, self._highest = setup.voltage_min, setup.voltage_max

    @property
    def is_running(self) -> bool:
        """True while output and input stream."""
        return self._output is not None

    def include(self, voltage: float) -> None:
        """Let outputs begin at a voltage [V] at which another program has left the card, outside the limits."""
        self._lowest, self._highest = min(self._lowest, voltage), max(self._highest, voltage)

    def start(self, sample_period: float, first: Samples) -> None:
        """Stream from now on: output without regeneration, beginning with `first`; input on the output's clock."""
        s, streams, constants = self._setup, self._nidaqmx, self._nidaqmx.constants
        self._sample_period, self._queued = sample_period, first.size * sample_period
        size = max(4 * first.size, round(1.0 / sample_period))
        continuous = constants.AcquisitionType.CONTINUOUS
        with self._faults("starting output and input"):
            try:
                self._output, self._input = self._output_task(), self._input_task()
                self._output.timing.cfg_samp_clk_timing(1 / sample_period, sample_mode=continuous, samps_per_chan=size)
                self._require_rate(1 / sample_period)
                self._output.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
                self._input.timing.cfg_samp_clk_timing(
                    1 / sample_period, f"/{s.device}/ao/SampleClock", sample_mode=continuous, samps_per_chan=size
                )
                self._writer = streams.stream_writers.AnalogSingleChannelWriter(self._output.out_stream, False)
                self._reader = streams.stream_readers.AnalogMultiChannelReader(self._input.in_stream)
                self._writer.verify_array_shape = self._reader.verify_array_shape = (
                    False  # the check asks the card at every call
                )
                self._writer.write_many_sample(first, s.timeout)
                self._input.start()  # waits for the clock of the output
                self._output.start()
            except BaseException:
                self.abandon()
                self.last_written = float(first[-1])  # `first` does not move the output
                raise

    def write(self, drive: Samples) -> None:
        """Append drive voltages [V] to the output."""
        self._queued = self._setup.lead + drive.size * self._sample_period
        with self._puts_out(drive), self._faults("writing output"):
            self._writer.write_many_sample(drive, self._setup.timeout)

    def read(self, count: int) -> Samples:
        """The next input voltages [V], shape (channels, count)."""
        samples = np.empty((2 if self._setup.voltage_input else 1, count))
        with self._faults("reading input"):
            got = self._reader.read_many_sample(samples, count, self._setup.timeout + self._setup.lead)
        if got != count:
            raise DaqmxError(f"NI-DAQmx, {self._setup.device}: got {got} samples, expected {count}")
        return self._finite(samples)

    def stop(self) -> None:
        """End both tasks; the output holds its last voltage."""
        fault: DaqmxError | None = None
        tasks, self._output, self._input = (self._output, self._input), None, None
        for task in tasks:
            if task is not None:
                try:
                    with self._faults("closing a task"):
                        task.close()
                except DaqmxError as error:
                    fault = error
        if fault is not None:
            raise fault

    def abandon(self, *, runs_dry: bool = False) -> None:
        """End both tasks if they can still be ended; the next call uses a new link.

        Parameters
        ----------
        runs_dry : bool
            Wait first until the output has put out everything that was written, so that `last_written` holds.
        """
        if self.is_running and not (runs_dry and self.last_written is not None and self._has_run_dry()):
            self.last_written = None
        with suppress(DaqmxError):
            self.stop()
        self.close()
        self._link = Link(self._setup, self._nidaqmx)

    def play(self, drive: Samples, sample_period: float) -> None:
        """Put out at least two drive voltages [V] once, on the clock of the card, and return when that is done."""
        s = self._setup
        finite = self._nidaqmx.constants.AcquisitionType.FINITE
        with self._faults("putting out a ramp"), self._output_task() as task:
            task.timing.cfg_samp_clk_timing(1 / sample_period, sample_mode=finite, samps_per_chan=drive.size)
            with self._puts_out(drive):
                task.write(drive, auto_start=False)
                task.start()
                task.wait_until_done(drive.size * sample_period + s.timeout)

    def output(self) -> float | None:
        """Voltage at the output [V], read back by the card itself; None if it cannot."""
        s = self._setup
        try:
            with self._faults("reading the output back"), self._link.task() as task:
                name, span = f"{s.device}/_{s.output}_vs_aognd", max(s.sensor_range, -s.voltage_min, s.voltage_max)
                task.ai_channels.add_ai_voltage_chan(name, min_val=-span, max_val=span)
                return float(self._finite(np.atleast_2d(np.asarray(task.read(), dtype=np.float64)))[0, 0])
        except UnsupportedError:
            return None

    def write_once(self, drive: float) -> None:
        """Put out one voltage [V] without a clock."""
        with self._faults("writing one voltage"), self._output_task() as task, self._puts_out(np.full(1, drive)):
            task.write(drive, auto_start=True)

    def read_once(self) -> Samples:
        """One reading of every input [V], without a clock."""
        with self._faults("reading one sample"), self._input_task() as task:
            return self._finite(np.atleast_1d(np.asarray(task.read(), dtype=np.float64)))

    def close(self) -> None:
        """Release the link to a server."""
        self._link.close()

    def _require_rate(self, asked: float) -> None:
        """DaqmxError if the card samples at another rate; it takes the nearest one that it has, without a message."""
        rate = float(self._output.timing.samp_clk_rate)
        if not abs(rate / asked - 1) <= _RATE_TOLERANCE:
            raise DaqmxError(
                f"NI-DAQmx, {self._setup.device}: samples every {1 / rate:.9g} s, expected {1 / asked:.9g} s; "
                "choose a whole multiple of the period of the card's timebase"
            )

    def _finite(self, samples: Samples) -> Samples:
        if not np.isfinite(samples).all():
            at = np.argwhere(~np.isfinite(samples))[0]
            raise DaqmxError(
                f"NI-DAQmx, {self._setup.device}: sample {at[-1]} of input {at[0]} is {samples[tuple(at)]}, "
                "expected finite numbers"
            )
        return samples

    def _output_task(self) -> Any:
        s, task = self._setup, self._link.task()
        task.ao_channels.add_ao_voltage_chan(f"{s.device}/{s.output}", min_val=self._lowest, max_val=self._highest)
        return task

    def _input_task(self) -> Any:
        s, task = self._setup, self._link.task()
        for name in (s.displacement_input, s.voltage_input):
            if name:
                channels = task.ai_channels
                channels.add_ai_voltage_chan(f"{s.device}/{name}", min_val=-s.sensor_range, max_val=s.sensor_range)
        return task

    def _has_run_dry(self) -> bool:
        """Wait until the buffer of the output is empty; False if the card does not say that it is."""
        try:
            with self._faults("waiting for the end of the output"):
                self._output.wait_until_done(self._queued + self._setup.timeout)
        except EmptyBufferError:
            return True
        except DaqmxError:
            pass
        return False

    @contextmanager
    def _puts_out(self, drive: Samples) -> Iterator[None]:
        """Know the last voltage that was written; it is uncertain after a fault, unless the output has stopped."""
        before, self.last_written = self.last_written, None
        try:
            yield
        except EmptyBufferError as error:
            self.last_written = float(drive[error.taken - 1]) if error.taken else before
            raise
        self.last_written = float(drive[-1])

    def _faults(self, doing: str) -> AbstractContextManager[None]:
        return reported(self._nidaqmx.errors, self._setup, doing)
