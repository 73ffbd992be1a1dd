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

"""`Gcs2Server`: an emulated controller behind a TCP port."""

from __future__ import annotations

import socket
import struct
import threading
from contextlib import suppress
from typing import Self

from ...errors import StageError
from .controller import BYTES, Controller, Reply

_CODE_PAGE = "cp1252"
"""Character set of GCS."""
_LONGEST_LINE = 1 << 20
"""Longest accepted line [bytes]."""


class Gcs2Server:
    """Serves any number of links in its own threads, one command at a time.

    Parameters
    ----------
    controller : Controller
        The emulated controller.
    host : str
        Address at which the server listens.
    port : int
        TCP port; 0 for any free port.

    Raises
    ------
    StageError
        If the port is not available.

    Examples
    --------
    >>> from piezo_hysteresis.stage.simulated import SimulatedStage
    >>> with Gcs2Server(Controller(SimulatedStage(sample_period=50e-6))) as server:
    ...     server.port > 0
    True
    """

    def __init__(self, controller: Controller, host: str = "127.0.0.1", port: int = 0) -> None:
        self._controller, self._turn, self._ended = controller, threading.Lock(), threading.Event()
        self._links: set[socket.socket] = set()
        self._threads: list[threading.Thread] = []
        if not 0 <= port <= 65535:
            raise StageError(f"gcs2 emulator: got port {port}, expected 0 to 65535")
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise StageError(f"gcs2 emulator: cannot listen at {host}:{port} ({error}); name another port") from None
        self.host, self.port = host, int(self._listener.getsockname()[1])

    def __enter__(self) -> Self:
        self._begin(self._accept)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port and every link, and wait for the threads."""
        self._ended.set()
        self._close_port()
        for link in list(self._links):
            _shut(link)
        for thread in list(self._threads):
            thread.join()

    def _begin(self, work: object, *arguments: object) -> None:
        thread = threading.Thread(target=work, args=arguments, daemon=True)  # type: ignore[arg-type]
        self._threads = [t for t in self._threads if t.is_alive()] + [thread]
        thread.start()

    def _close_port(self) -> None:
        _shut(self._listener)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                link, _ = self._listener.accept()
            except OSError:
                return
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._links.add(link)
            self._begin(self._serve, link)

    def _serve(self, link: socket.socket) -> None:
        waiting = b""
        try:
            while part := link.recv(1 << 16):
                commands, waiting = cut(waiting + part)
                for command in commands:
                    with self._turn:
                        reply = self._controller.carry_out(command)
                    self._send(link, reply)
        except OSError:
            pass
        finally:
            self._links.discard(link)
            link.close()

    def _send(self, link: socket.socket, reply: Reply) -> None:
        struck, lines = reply.struck, list(reply.lines or ())
        if "slow" in struck and self._ended.wait(struck["slow"]):
            return
        if "garbled" in struck and lines:
            lines[-1 - len(lines) // 4] = "".join("nan" if c.isdigit() else c for c in lines[-1 - len(lines) // 4][:9])
        if "absurd" in struck and lines:
            lines[-1] = f"{lines[-1].rpartition('=')[0]}={struck['absurd']:g}".lstrip("=")
        text = " \n".join(lines).encode(_CODE_PAGE, errors="replace") + b"\n" if lines else b""
        if struck.keys() & {"link_lost", "reset", "gone", "partial_answer"}:
            text = text[: len(text) // 2]
        for byte in text if "trickle" in struck else b"":
            link.sendall(bytes([byte]))
            if self._ended.wait(struck["trickle"]):
                return
        link.sendall(b"" if "trickle" in struck else text)
        if "gone" in struck:
            self._close_port()
        if "reset" in struck:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closing sends a RST
        if struck.keys() & {"link_lost", "reset", "gone"}:
            raise OSError("a requested fault of the emulator")


def cut(received: bytes) -> tuple[list[str], bytes]:
    """The complete commands in the received bytes, and the bytes of an incomplete one."""
    commands: list[str] = []
    while received:
        if chr(received[0]) in BYTES:
            commands.append(chr(received[0]))
            received = received[1:]
            continue
        line, feed, rest = received.partition(b"\n")
        if not feed:
            return commands, received[:_LONGEST_LINE]
        commands.append(line.decode(_CODE_PAGE, errors="replace").strip())
        received = rest
    return commands, b""


def _shut(link: socket.socket) -> None:
    with suppress(OSError):  # not connected
        link.shutdown(socket.SHUT_RDWR)
