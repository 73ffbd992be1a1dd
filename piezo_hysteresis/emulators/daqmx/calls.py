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

"""`Calls`: the calls of NI's gRPC device server that clocked analogue output and input need, under NI's names."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .card import NOT_RUNNING, Card, CardError

_ANALOG_INPUT, _ANALOG_OUTPUT, _VOLTAGE = 10100, 10102, 10322
"""NI-DAQmx values: kinds of channel, and of measurement."""
_KIND_OF_CHANNEL = 0x187F
"""NI-DAQmx attribute: kind of a channel."""
_GROUP_BY_CHANNEL = 0
"""NI-DAQmx value: the samples of one channel are consecutive in the array."""
_FINITE, _WITHOUT_REGENERATION = 10178, 10158
"""NI-DAQmx values: finite sampling, and output without regeneration."""
_REGENERATION, _SAMPLE_CLOCK_RATE = 0x1453, 0x1344
"""NI-DAQmx attributes: regeneration, and rate of the sample clock."""
_VERSION = {0x1272: 26, 0x1923: 0, 0x2F22: 0}
"""NI-DAQmx attributes of the version: major, minor, update."""
_NAME_OF_TASK, _CHANNELS_OF_TASK = 0x1276, 0x1273
"""NI-DAQmx attributes: name and channels of a task."""
_TIMEOUT = (-200284, "Some or all of the samples requested have not yet been acquired.")
"""Error number and text of a read whose samples were not available in time."""
_NOT_DONE = (-200560, "Wait Until Done did not indicate that the task was done within the specified timeout.")
"""Error number and text of a wait for a task that did not end in time."""
_NO_REGENERATION = (-200077, "Regeneration is not emulated; set out_stream.regen_mode to DONT_ALLOW_REGENERATION.")
"""Error number and text of a task that is set to regenerate."""


@dataclass(slots=True)
class Task:
    """The configuration of a task.

    Parameters
    ----------
    kind : int
        NI-DAQmx value of the kind of its channels; 0 for none.
    channels : list of str
        Names of its channels without the device.
    rate : float
        Rate of the sample clock [Hz]; 0 without a clock.
    samples : int
        Number of samples per channel of a finite task.
    is_finite : bool
        Whether the task ends after `samples`.
    regenerates : bool
        Whether old samples are repeated if the buffer is empty.
    """

    kind: int = 0
    channels: list[str] = field(default_factory=list)
    rate: float = 0.0
    samples: int = 0
    is_finite: bool = False
    regenerates: bool = True


class Calls:
    """Carries out calls on a card; every public name beginning with a capital is a call.

    Parameters
    ----------
    card : Card
        The emulated card; only one thread uses it at a time.
    """

    def __init__(self, card: Card) -> None:
        self._card, self._turn, self._ended = card, threading.Lock(), threading.Event()
        self._tasks: dict[str, Task] = {}
        self._started: Task | None = None

    def names(self) -> list[str]:
        """Names of the calls."""
        return [name for name in dir(self) if name[0].isupper()]

    def count(self, name: str) -> dict[str, float]:
        """Count a call, and return the single faults that occur at it, with their values."""
        with self._turn:
            if "underflow" in (struck := self._card.faults.count(name)):
                self._card.run_dry()
        return struck

    def end(self) -> None:
        """End all waits and tasks; the card keeps its present voltage."""
        self._ended.set()
        with self._turn:
            self._card.stop()

    def sleep(self, seconds: float) -> None:
        """Wait for a time [s], or until the server ends."""
        self._ended.wait(seconds)

    def CreateTask(self, request: Any) -> dict[str, Any]:
        with self._turn:
            name = f"task{len(self._tasks) + 1}"
            self._tasks[name] = Task()
        return {"task": {"name": name}, "new_session_initialized": True}

    def ClearTask(self, request: Any) -> dict[str, Any]:
        task = self._tasks.get(request.task.name, Task())
        with self._turn:
            if task.kind == _ANALOG_OUTPUT and task.rate:
                self._card.stop()
        task.kind, task.rate = 0, 0.0
        return {}

    def CreateAOVoltageChan(self, request: Any) -> dict[str, Any]:
        return self._add(request, _ANALOG_OUTPUT)

    def CreateAIVoltageChan(self, request: Any) -> dict[str, Any]:
        return self._add(request, _ANALOG_INPUT)

    def CfgSampClkTiming(self, request: Any) -> dict[str, Any]:
        task = self._task(request)
        task.rate, task.samples = self._card.coerced(request.rate), request.samps_per_chan
        task.is_finite = request.sample_mode_raw == _FINITE
        return {}

    def GetTimingAttributeDouble(self, request: Any) -> dict[str, Any]:
        return {"value": self._task(request).rate if request.attribute_raw == _SAMPLE_CLOCK_RATE else 0.0}

    def SetWriteAttributeInt32(self, request: Any) -> dict[str, Any]:
        if request.attribute_raw == _REGENERATION:
            self._task(request).regenerates = request.value_raw != _WITHOUT_REGENERATION
        return {}

    def StartTask(self, request: Any) -> dict[str, Any]:
        task = self._task(request)
        if task.kind == _ANALOG_OUTPUT:
            if task.regenerates and not task.is_finite:
                raise CardError(*_NO_REGENERATION)
            with self._turn:
                self._require_server()
                self._card.start(task.rate, task.is_finite)
                self._started = task
        return {}

    def StopTask(self, request: Any) -> dict[str, Any]:
        if self._task(request).kind == _ANALOG_OUTPUT:
            with self._turn:
                self._card.stop()
        return {}

    def IsTaskDone(self, request: Any) -> dict[str, Any]:
        with self._turn:
            return {"is_task_done": self._card.left <= 0}

    def WaitUntilTaskDone(self, request: Any) -> dict[str, Any]:
        self._wait(lambda: self._card.left, request.time_to_wait, _NOT_DONE)
        if not self._task(request).is_finite:  # only so does a task without an end, and without regeneration, end
            with self._turn:
                self._card.run_dry()
                self._card.require_output()
        return {}

    def WriteAnalogF64(self, request: Any) -> dict[str, Any]:
        values, task = np.array(request.write_array), self._task(request)
        with self._turn:
            self._require_server()
            if task is self._started:
                self._card.require_output()
            if task.rate:
                self._card.write(values)
            else:
                self._card.set(float(values[-1]))
        return {"samps_per_chan_written": request.num_samps_per_chan}

    def WriteAnalogScalarF64(self, request: Any) -> dict[str, Any]:
        with self._turn:
            self._require_server()
            self._card.set(request.value)
        return {}

    def ReadAnalogF64(self, request: Any) -> dict[str, Any]:
        task = self._task(request)
        wanted = request.num_samps_per_chan
        if wanted < 0:
            wanted = self._card.available if task.rate and not task.is_finite else task.samples
        if task.rate:
            self._wait(lambda: self._card.remaining(wanted), request.timeout, _TIMEOUT)
        with self._turn:
            values = self._card.read(task.channels, wanted) if task.rate else self._card.look(task.channels)
        count = values.shape[1]
        if request.fill_mode_raw != _GROUP_BY_CHANNEL:
            values = values.T
        padded = np.zeros(max(request.array_size_in_samps, values.size))
        padded[: values.size] = values.ravel()
        return {"read_array": padded, "samps_per_chan_read": count}

    def ReadAnalogScalarF64(self, request: Any) -> dict[str, Any]:
        with self._turn:
            return {"value": float(self._card.look(self._task(request).channels)[0, 0])}

    def GetSystemInfoAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": _VERSION.get(request.attribute_raw, 0)}

    def GetTaskAttributeString(self, request: Any) -> dict[str, Any]:
        attributes = {_NAME_OF_TASK: request.task.name, _CHANNELS_OF_TASK: self._listed(request)}
        return {"value": attributes.get(request.attribute_raw, "")}

    def GetTaskAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": len(self._task(request).channels)}

    def GetReadAttributeString(self, request: Any) -> dict[str, Any]:
        return {"value": self._listed(request)}

    def GetReadAttributeUInt32(self, request: Any) -> dict[str, Any]:
        return {"value": len(self._task(request).channels)}

    def GetChanAttributeInt32(self, request: Any) -> dict[str, Any]:
        return {"value_raw": self._task(request).kind if request.attribute_raw == _KIND_OF_CHANNEL else _VOLTAGE}

    def _require_server(self) -> None:
        """Raise CardError if the server has ended, so that a call in progress puts nothing into the output buffer."""
        if self._ended.is_set():
            raise CardError(NOT_RUNNING, "The server has ended.")

    def _task(self, request: Any) -> Task:
        return self._tasks[request.task.name]

    def _listed(self, request: Any) -> str:
        return ", ".join(self._task(request).channels)

    def _add(self, request: Any, kind: int) -> dict[str, Any]:
        channel = request.physical_channel.partition("/")[2]
        if channel not in ("ao0", *self._card.inputs):
            raise CardError(-200170, f"Physical channel specified does not exist on this device: {channel}")
        task = self._task(request)
        task.kind = kind
        task.channels.append(channel)
        return {}

    def _wait(self, remaining: Callable[[], float], timeout: float, error: tuple[int, str]) -> None:
        """Wait until `remaining` returns 0 s or less, without blocking other calls; CardError after `timeout` [s]."""
        due = time.monotonic() + timeout if timeout >= 0 else float("inf")
        while True:
            with self._turn:
                left = remaining()
            if left <= 0:
                return
            if time.monotonic() + left > due or self._ended.is_set():
                raise CardError(*error)
            self._ended.wait(left)
