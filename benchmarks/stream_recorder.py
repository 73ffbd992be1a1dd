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

"""`StreamRecorder`: the third process of the streaming benchmark, which records."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

from benchmarks.stream_sender import ENDED
from piezo_hysteresis.nodes.identification.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import COMMAND_STATUS

PATIENCE = 60.0
CATCH_UP = 5.0
"""What the model node may be behind at the end [s]; what comes later counts as lost."""
_ON_ITS_WAY = 1.0
"""Time that a waveform takes to the driver at most [s]."""
_LOOK = 0.05
"""Time between two looks at what is waited for [s]."""


class StreamRecorder:
    """Records an axis, and what became of the waveforms that were sent to it.

    Parameters
    ----------
    namespace : str
        Of the axis.
    folder : pathlib.Path
        For the bag.
    executor : Executor
        That of all axes.
    check : callable
        Raises where a node has ended.
    topics : collection of str
        What is recorded.

    Attributes
    ----------
    begun : int
        Waveforms that the driver has begun.
    played : list of int
        Index of the first sample of every waveform that was played to its end.
    """

    def __init__(
        self, namespace: str, folder: Path, executor: Executor, check: Callable[[], None], topics: Collection[str]
    ) -> None:
        self._check, self._executor = check, executor
        self._node = Node("recorder", namespace=namespace)
        self._executor.add_node(self._node)
        self._never = Future()
        self.begun, self.played = 0, list[int]()
        self._failure = ""
        self._node.create_subscription(DiagnosticStatus, "command_status", self._on_status, COMMAND_STATUS)
        self.bag = BagRecorder(self._node, folder, topics)

    def _on_status(self, status: DiagnosticStatus) -> None:
        values = values_of(status)
        if values["state"] == "playing":
            self.begun += 1
        elif values["state"] == "done":
            self.played.append(int(values["first_index"]))
        elif values["state"] in ENDED:
            self._failure = f"the driver did not play {status.name}: {status.message}"

    def wait(self, done: Callable[[], bool], what: str, timeout: float = PATIENCE) -> None:
        """Spin until `done`."""
        end = time.monotonic() + timeout
        while not done():
            self._executor.spin_until_future_complete(self._never, timeout_sec=_LOOK)
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: nothing after {timeout:g} s")
            if self._failure:
                raise RuntimeError(self._failure)
            self._check()

    def pause(self, duration: float) -> None:
        """Spin for a while [s]."""
        end = time.monotonic() + duration
        self.wait(lambda: time.monotonic() > end, "the end of a pause", duration + PATIENCE)

    def follow(self, size: int) -> None:
        """Spin until all has been played and recorded, and the model node had its time to catch up.

        Parameters
        ----------
        size : int
            Samples of a waveform.
        """
        self.pause(_ON_ITS_WAY)
        self.wait(lambda: len(self.played) == self.begun, "the end of the last waveform")
        self.wait(lambda: self.bag.holds((self.played[-1] + size - 1) % 2**32), "the last sample")
        caught_up, end = self.bag.counts["samples"], time.monotonic() + CATCH_UP
        while self.bag.counts["predicted_samples"] < caught_up and time.monotonic() < end:
            self.pause(0.1)

    def close(self) -> None:
        """End the bag and leave the graph."""
        self.bag.close()
        self._node.destroy_node()
