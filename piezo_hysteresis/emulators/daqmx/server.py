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

"""`DaqmxServer`: an emulated card behind the port of NI's gRPC device server."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Self

import numpy as np

from ...errors import StageError
from ...stage.description import Samples
from .calls import Calls
from .card import Card, CardError

_LATE = (-200284, "Some or all of the samples requested have not yet been acquired.")
"""Error number and text for samples that are not available in time."""
_RESOURCE_LOST = (-200324, "Device not available for routing. It is possible that it was removed.")
"""Error number and text for a card that was unplugged."""


class DaqmxServer:
    """Serves the calls that clocked analogue output and input need; gRPC reports every other call as unimplemented.

    Parameters
    ----------
    card : Card
        The emulated card.
    host : str
        Address at which the server listens.
    port : int
        TCP port; 31763 is that of NI's examples, 0 is any free one.

    Raises
    ------
    StageError
        If the package ``nidaqmx[grpc]`` is not installed, or the port is not available.
    """

    def __init__(self, card: Card, host: str = "127.0.0.1", port: int = 0) -> None:
        try:
            import grpc
            from nidaqmx._stubs import nidaqmx_pb2, nidaqmx_pb2_grpc
        except ImportError:
            raise StageError(
                "NI emulator: the package nidaqmx is not installed, expected it; pip install 'nidaqmx[grpc]'"
            ) from None
        if not 0 <= port <= 65535:  # gRPC would take the remainder
            raise StageError(f"NI emulator: got port {port}, expected 0 to 65535")
        self._calls, self._messages, self._grpc = Calls(card), nidaqmx_pb2, grpc
        self._gone = False
        self._last: Samples = np.empty((0, 0))
        answers = {name: self._answering(name) for name in self._calls.names()}
        service = type("Service", (nidaqmx_pb2_grpc.NiDAQmxServicer,), answers)
        unlimited = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
        self._server = grpc.server(ThreadPoolExecutor(4), options=[*unlimited, ("grpc.so_reuseport", 0)])
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(service(), self._server)
        try:
            self.port = int(self._server.add_insecure_port(f"{host}:{port}"))
        except RuntimeError:
            raise StageError(f"NI emulator: cannot listen at {host}:{port}; name another port") from None
        self.host = host

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port and every link."""
        self._calls.end()
        self._server.stop(None).wait()

    def _answering(self, name: str) -> Any:
        call = getattr(self._calls, name)

        def answer(_: object, request: Any, context: Any) -> Any:
            struck = self._calls.count(name)
            self._calls.sleep(struck.get("slow", 0.0))
            self._gone |= "gone" in struck
            try:
                if self._gone or "link_lost" in struck:
                    context.abort(self._grpc.StatusCode.UNAVAILABLE, "a requested fault of the emulator")
                self._refuse(struck)
                values = call(request)
                if name == "ReadAnalogF64":
                    self._spoil(values, struck)
            except CardError as error:
                context.set_trailing_metadata((("ni-error", str(error.number)),))
                context.abort(self._grpc.StatusCode.UNKNOWN, str(error))
            return getattr(self._messages, f"{name}Response")(**values)

        return answer

    def _refuse(self, struck: dict[str, float]) -> None:
        if "error" in struck:
            raise CardError(int(struck["error"]), "A requested fault of the emulator.")
        if "device_lost" in struck:
            raise CardError(*_RESOURCE_LOST)
        if "late" in struck:
            raise CardError(*_LATE)

    def _spoil(self, values: dict[str, Any], struck: dict[str, float]) -> None:
        read = values["read_array"]
        if "duplicated" in struck and self._last.size:
            read[:] = np.resize(self._last, read.size)
        if "garbled" in struck:
            read[read.size // 2] = np.nan
        values["samps_per_chan_read"] -= int("short_read" in struck)
        self._last = read.copy()
