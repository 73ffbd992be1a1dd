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

"""`Connection`: lines to and from a GCS 2.0 controller over TCP, with time-outs and without busy waiting."""

from __future__ import annotations

import socket
import time

from ...errors import DeviceError

_CODE_PAGE = "cp1252"
"""Character set of GCS."""
_LONGEST_ANSWER = 1 << 26
"""Largest size of an answer [byte]."""


class Gcs2Error(DeviceError):
    """The controller refused a command, its answer is invalid, or the link failed."""


class NoAnswerError(Gcs2Error):
    """No byte arrived before the deadline."""


class Connection:
    """A TCP link. It is opened when needed, and closed when query and answer may no longer match.

    After a time-out or half an answer it is unknown to which query the next bytes belong; the link is then closed, and
    the next `send` opens a new one.

    Parameters
    ----------
    host : str
        Name or address of the controller.
    port : int
        TCP port; 50000 on PI controllers.
    timeout : float
        Deadline for opening, for sending, and for a complete answer [s].
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self.host, self.port, self.timeout = host, port, timeout
        self._socket: socket.socket | None = None

    @property
    def place(self) -> str:
        """Host and port, as messages name them."""
        return f"{self.host}:{self.port}"

    @property
    def is_open(self) -> bool:
        """True while there is a link; a link that broke unnoticed counts as one."""
        return self._socket is not None

    def send(self, text: str) -> None:
        """Send bytes unchanged; a line must contain its line feed.

        Raises
        ------
        Gcs2Error
            If no link can be opened, or the link is lost.
        """
        link = self._opened()
        try:
            link.settimeout(self.timeout)  # the deadline is that of the whole text, in any number of parts
            link.sendall(text.encode(_CODE_PAGE))
        except OSError as error:
            raise self._lost(f"lost the link while sending ({error})") from None

    def receive(self) -> list[str]:
        """The next answer, line by line, without line feeds and the spaces before them.

        Every line of an answer but the last ends with space and line feed, the last with a line feed alone.

        Raises
        ------
        NoAnswerError
            If nothing came before the deadline; the link stays open.
        Gcs2Error
            If the link is lost or only a part of an answer came before the deadline; the link is closed.
        """
        link = self._opened()
        answer, deadline = bytearray(), time.monotonic() + self.timeout
        while not answer.endswith(b"\n") or answer.endswith(b" \n"):
            try:
                link.settimeout(max(deadline - time.monotonic(), 1e-3))
                part = link.recv(1 << 16)
                if time.monotonic() > deadline and not part.endswith(b"\n"):
                    raise TimeoutError
            except TimeoutError:
                if not answer:
                    raise NoAnswerError(f"{self.place}: no answer within {self.timeout:g} s") from None
                raise self._lost(
                    f"the answer stopped after {len(answer)} bytes, expected its end within {self.timeout:g} s"
                ) from None
            except OSError as error:
                raise self._lost(f"lost the link while reading ({error})") from None
            if not part:
                raise self._lost(f"the link was closed from the other side after {len(answer)} bytes of an answer")
            answer += part
            if len(answer) > _LONGEST_ANSWER:
                raise self._lost(f"got {len(answer)} bytes, expected the end of an answer")
        lines = answer.decode(_CODE_PAGE, errors="replace").split("\n")[:-1]
        return [line.rstrip() for line in lines]

    def close(self) -> None:
        """Close the link; may be repeated."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _opened(self) -> socket.socket:
        if self._socket is None:
            try:
                link = socket.create_connection((self.host, self.port), self.timeout)
            except OSError as error:
                raise Gcs2Error(
                    f"{self.place}: cannot connect ({error}), expected a controller; check address, cable, power"
                ) from None
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket = link
        return self._socket

    def _lost(self, words: str) -> Gcs2Error:
        self.close()
        return Gcs2Error(f"{self.place}: {words}")
