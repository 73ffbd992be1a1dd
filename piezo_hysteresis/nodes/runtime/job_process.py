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

"""`JobProcess`: runs a long job in its own process, so that the node can answer. No ROS."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from ...errors import IdentificationError, PiezoError

Message = TypeVar("Message")
Report = Callable[[str, float], None]


class JobProcess(Generic[Message]):
    """One job, from its start to its result. Its process ends when this process ends.

    Parameters
    ----------
    name : str
        One word for the job, for messages.
    job : callable
        A function of a module, so that the other process finds it. It is called with an `Exchange` and `arguments`;
        what it returns is its last message.
    arguments : object
        For the job.

    Attributes
    ----------
    progress : (str, float)
        What is computed, and the fraction done.
    """

    def __init__(self, name: str, job: Callable[..., Message], *arguments: object) -> None:
        self._name = name
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_work, args=(other, name, job, arguments), daemon=True)
        self._process.start()
        other.close()
        self.progress: tuple[str, float] = ("starting", 0.0)

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return self._process.pid

    def send(self, answer: object) -> None:
        """Send a message to the job.

        Raises
        ------
        IdentificationError
            If its process died.
        """
        try:
            self._connection.send(answer)
        except ConnectionError:
            raise self._death() from None

    def poll(self) -> Message | None:
        """The next message of the job, or None while there is none.

        Raises
        ------
        IdentificationError
            With the reason, if the job failed or its process died.
        """
        while self._connection.poll():
            try:
                kind, content = self._connection.recv()
            except (EOFError, ConnectionError):  # it died with an unread message
                raise self._death() from None
            if kind == _FAILURE:
                raise IdentificationError(content)
            if kind == _MESSAGE:
                message: Message = content
                return message
            self.progress = content
        return None

    def close(self) -> None:
        """End the job, finished or not."""
        self._process.terminate()
        self._process.join(1.0)
        if self._process.is_alive():  # a suspended process does not hear SIGTERM
            self._process.kill()
            self._process.join()
        self._connection.close()

    def _death(self) -> IdentificationError:
        self._process.join(1.0)  # its end of the connection closes before its exit code is known
        return IdentificationError(
            f"the {self._name} ended without a result (exit code {self._process.exitcode}); out of memory?"
        )


class Exchange:
    """The messages between a job and the node.

    Parameters
    ----------
    connection : Connection
        To the `JobProcess`.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def report(self, word: str, fraction: float) -> None:
        """Report the present computation and the fraction done."""
        self._connection.send((_PROGRESS, (word, fraction)))

    def send(self, message: object) -> None:
        """Send a message, which `JobProcess.poll` returns."""
        self._connection.send((_MESSAGE, message))

    def receive(self) -> Any:
        """Wait for a message of `JobProcess.send`."""
        return self._connection.recv()

    def fail(self, reason: str) -> None:
        """Report why there is no result."""
        self._connection.send((_FAILURE, reason))


_PROGRESS, _MESSAGE, _FAILURE = range(3)
"""Kinds of messages from the job to the node."""


def _end_with_parent() -> None:
    """End this process when the node dies, also by SIGKILL, because the job would continue for minutes."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(connection: Connection, name: str, job: Callable[..., object], arguments: tuple[object, ...]) -> None:
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the signal is meant for the node, which ends this process
    exchange = Exchange(connection)
    try:
        exchange.send(job(exchange, *arguments))
    except PiezoError as error:
        exchange.fail(str(error))
    except Exception as error:
        exchange.fail(f"fault of the {name}: {error!r}; the traceback is in the log")
        raise
