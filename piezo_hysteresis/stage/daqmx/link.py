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

"""`Link`: the tasks of the local driver, or of a device server over gRPC."""

from __future__ import annotations

from typing import Any

from .setup import DaqmxSetup

_OPTIONS = (
    ("grpc.max_receive_message_length", -1),
    ("grpc.max_send_message_length", -1),
    ("grpc.use_local_subchannel_pool", 1),  # a new channel opens a new link instead of waiting for the old one
)
"""Options of the link to the server."""


class Link:
    """What makes the tasks of a card.

    Parameters
    ----------
    setup : DaqmxSetup
    nidaqmx : module
        NI's package.
    """

    def __init__(self, setup: DaqmxSetup, nidaqmx: Any) -> None:
        self._nidaqmx = nidaqmx
        self._channel: Any = None
        if setup.server:
            import grpc

            from .deadline import Deadline

            self._channel = grpc.insecure_channel(setup.server, options=_OPTIONS)
            self._calls = grpc.intercept_channel(self._channel, Deadline(setup.timeout))

    def task(self) -> Any:
        """A new task."""
        if self._channel is None:
            return self._nidaqmx.Task()
        return self._nidaqmx.Task(grpc_options=self._nidaqmx.GrpcSessionOptions(self._calls, ""))

    def close(self) -> None:
        """Release the server."""
        if self._channel is not None:
            self._channel.close()
