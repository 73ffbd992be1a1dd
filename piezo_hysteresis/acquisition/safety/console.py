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

"""`Console`: a process that writes a line does not wait until its terminal, or the reader of its pipe, takes it.

rclpy holds the lock of the interpreter while it writes a line of the log. If the terminal is paused, or nobody reads
the pipe, this line would stop all threads: the stage would keep its voltage, and no signal or service could change it.
A line of `piezo` would stop its main thread, which then could not make the stage safe. No ROS.
"""

from __future__ import annotations

import faulthandler
import io
import os
import select
import stat
import sys
import threading
import time
from contextlib import suppress
from fcntl import F_SETPIPE_SZ, fcntl
from typing import Any, Self

from ...errors import counted

STREAMS = {1: "stdout", 2: "stderr"}
"""Names in `sys` of the streams of each descriptor."""
CAPACITY = 1 << 18
"""Size of a pipe [bytes]."""
LONGEST_BACKLOG = 1 << 20
"""Text that is kept for a terminal that takes none [bytes]. Later lines are lost."""
LONGEST_DRAIN = 1.0
"""Longest wait at the end until the terminal has taken everything [s]."""
_LONGEST_WAIT = 0.2
"""Longest wait of a line of Python code for room in the pipe [s]; it does not hold the lock of the interpreter."""


class Console:
    """Puts pipes that are always read before stdout and stderr, while its context is entered.

    Threads forward the text. If the terminal takes none for long, lines are lost, and a line says how many. At the end,
    the text that is left has a limited time; the descriptors are then those of the terminal again. Files are left as
    they are: nobody waits for them, and they then contain the last words of a process that crashes. The `fileno` of
    `sys.stderr` is that of the terminal, for processes that outlive this one; descriptors 1 and 2 of a child are the
    pipes, which nobody reads after the end.
    """

    def __enter__(self) -> Self:
        self._outlets: dict[int, _Outlet] = {}
        self._streams: dict[str, tuple[io.TextIOWrapper, io.TextIOWrapper]] = {}
        for number in STREAMS:
            if _may_block(number):
                same = (outlet for outlet in self._outlets.values() if outlet.leads_to(number))  # keeps their order
                self._outlets[number] = next(same, None) or _Outlet(number)
        _keep_colours()
        for number, outlet in self._outlets.items():
            name = STREAMS[number]
            stream = getattr(sys, name)
            if _writes_to(stream, number):
                with suppress(OSError):  # its reader has ended
                    stream.flush()
                self._streams[name] = stream, _text_stream(number, outlet.real, stream)
                setattr(sys, name, self._streams[name][1])
            os.dup2(outlet.entry, number)
        if 2 in self._outlets and faulthandler.is_enabled():
            faulthandler.enable(self._outlets[2].real)  # nobody forwards the last words of a process
        return self

    def __exit__(self, *_: object) -> None:
        for name, (before, stream) in self._streams.items():
            stream.flush()
            setattr(sys, name, before)
        until = time.monotonic() + LONGEST_DRAIN
        drained = {outlet for outlet in set(self._outlets.values()) if outlet.drain(until)}
        for number, outlet in self._outlets.items():
            os.dup2(outlet.real, number)
        if 2 in self._outlets and faulthandler.is_enabled():
            faulthandler.enable(2)
        for outlet in drained:  # the threads of the others still use their descriptors
            outlet.close()


class _Outlet:
    """A pipe, and the threads that empty it into the file to which a descriptor leads.

    One thread empties the pipe, also while the other waits for the terminal: in a full pipe, a line of C code would be
    lost without a trace.

    Attributes
    ----------
    real : int
        Descriptor of the file.
    entry : int
        Descriptor of the pipe; to write to it never blocks.
    """

    def __init__(self, number: int) -> None:
        self.real = os.dup(number)
        self._read, self.entry = os.pipe()
        self._ended, self._end = os.pipe()  # child processes may hold the pipe open: its end is not the end
        os.set_blocking(self.entry, False)
        with suppress(OSError):  # the user has many large pipes
            fcntl(self.entry, F_SETPIPE_SZ, CAPACITY)
        self._changed = threading.Condition()
        self._backlog, self._lost, self._is_complete = bytearray(), 0, False
        self._forwarder = threading.Thread(target=self._forward, name="console", daemon=True)
        for thread in (self._forwarder, threading.Thread(target=self._collect, name="console pipe", daemon=True)):
            thread.start()

    def leads_to(self, number: int) -> bool:
        """Whether a descriptor leads to the same file."""
        return os.path.sameopenfile(self.real, number)

    def drain(self, until: float) -> bool:
        """End the threads; returns whether everything was forwarded until a time of `time.monotonic`."""
        os.write(self._end, b".")
        self._forwarder.join(max(until - time.monotonic(), 0.0))
        return not self._forwarder.is_alive()

    def close(self) -> None:
        """Close all descriptors, after a drain."""
        for descriptor in (self.real, self._read, self.entry, self._ended, self._end):
            os.close(descriptor)

    def _collect(self) -> None:
        while self._read in select.select([self._read, self._ended], [], [])[0]:
            text = os.read(self._read, CAPACITY)
            with self._changed:
                if self._lost or len(self._backlog) + len(text) > LONGEST_BACKLOG:
                    self._lost += max(text.count(b"\n"), 1)
                else:
                    self._backlog += text
                self._changed.notify()
        with self._changed:
            self._is_complete = True
            self._changed.notify()

    def _forward(self) -> None:
        while text := self._next():
            _write(self.real, text)

    def _next(self) -> bytes:
        """All text that waits, and how many lines after it were lost; empty at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._backlog or self._is_complete)
            text, self._backlog = bytes(self._backlog), bytearray()
            lost, self._lost = self._lost, 0
        if not lost:
            return text
        gap = b"" if text.endswith(b"\n") else b"\n"
        return text + gap + f"{counted(lost, 'line')} lost: the terminal or the pipe took none\n".encode()


class _Stream(io.RawIOBase):
    """Writes to a descriptor that does not block. It never raises; text that finds no room in time is lost."""

    def __init__(self, number: int, real: int) -> None:
        self.name, self._number, self._real = f"<{STREAMS[number]}>", number, real

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._real

    def isatty(self) -> bool:
        return os.isatty(self._real)

    def write(self, text: Any, /) -> int:
        rest = memoryview(text).cast("B")
        size = len(rest)
        with suppress(OSError):
            while rest and select.select([], [self._number], [], _LONGEST_WAIT)[1]:
                with suppress(BlockingIOError):  # another thread has taken the room
                    rest = rest[os.write(self._number, rest) :]
        return size


def _text_stream(number: int, real: int, model: io.TextIOWrapper) -> io.TextIOWrapper:
    """A stream with the encoding and the buffering of another one."""
    return io.TextIOWrapper(
        _Stream(number, real),
        encoding=model.encoding,
        errors=model.errors,
        line_buffering=model.line_buffering,
        write_through=model.write_through,
    )


def _may_block(number: int) -> bool:
    """Whether a descriptor leads to a terminal, a pipe or a socket."""
    try:
        mode = os.fstat(number).st_mode
    except OSError:  # closed
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(number)


def _writes_to(stream: object, number: int) -> bool:
    """Whether a stream writes to a descriptor; those of a test may write to the memory."""
    try:
        return isinstance(stream, io.TextIOWrapper) and stream.fileno() == number
    except ValueError:
        return False


def _keep_colours() -> None:
    """Let the log of ROS 2 have colours and show every line at once in a terminal, although it writes to a pipe."""
    number = 1 if os.environ.get("RCUTILS_LOGGING_USE_STDOUT") == "1" else 2
    if os.isatty(number):
        os.environ.setdefault("RCUTILS_COLORIZED_OUTPUT", "1")
        os.environ.setdefault("RCUTILS_LOGGING_BUFFERED_STREAM", "1")  # by lines


def _write(descriptor: int, text: bytes) -> None:
    rest = memoryview(text)
    while rest:
        try:
            rest = rest[os.write(descriptor, rest) :]
        except BlockingIOError:  # another process has set this for the terminal that it shares
            select.select([], [descriptor], [])
        except OSError:  # the terminal is closed
            return
