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

"""`FitProcess`: a fit in a process of its own, so that the node goes on answering. No ROS."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from ...errors import IdentificationError, PiezoError

Report = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a fit.

    Parameters
    ----------
    model : str
        Text of the model file.
    summary : str
        Result with its uncertainties and warnings, several lines.
    verdict : str
        One line.
    """

    model: str
    summary: str
    verdict: str


Job = Callable[[Path, str, Report], Outcome]
"""Takes the path of the data, the text of the model so far, and what takes progress."""


class FitProcess:
    """One fit, from its start to its outcome; ends with this process.

    Parameters
    ----------
    job : callable
        A function of a module, so that the other process finds it.
    path : Path
        Of the data.
    model : str
        Text of a model file, or empty.
    """

    def __init__(self, job: Job, path: Path, model: str = "") -> None:
        context = multiprocessing.get_context("spawn")
        self._results, answers = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(answers, job, path, model), daemon=True)
        self._process.start()
        answers.close()
        self.progress: tuple[str, float] = ("starting", 0.0)

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return self._process.pid

    def poll(self) -> Outcome | None:
        """The outcome, or None while the fit goes on.

        Raises
        ------
        IdentificationError
            With the reason, if the fit failed or its process died.
        """
        while self._results.poll():
            try:
                message = self._results.recv()
            except EOFError:
                raise IdentificationError(
                    f"the fit ended without a result (exit code {self._process.exitcode}); out of memory?"
                ) from None
            if isinstance(message, Outcome):
                return message
            if isinstance(message, str):
                raise IdentificationError(message)
            self.progress = message
        return None

    def close(self) -> None:
        """End the fit, finished or not."""
        self._process.terminate()
        self._process.join()
        self._results.close()


def end_with_parent() -> None:
    """Also where the node is killed: a fit without anybody to take it would go on for minutes."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(answers: Connection, job: Job, path: Path, model: str) -> None:
    threading.Thread(target=end_with_parent, name="parent", daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # meant for the node, which ends this process
    try:
        answers.send(job(path, model, lambda word, fraction: answers.send((word, fraction))))
    except PiezoError as error:
        answers.send(str(error))
    except Exception as error:
        answers.send(f"fault of the fit: {error!r}; the traceback is in the log")
        raise
