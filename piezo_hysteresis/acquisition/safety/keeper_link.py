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

"""`KeeperLink`: starts the keeper of a stage, and sends it the heartbeats of the driver. No ROS."""

from __future__ import annotations

import json
import math
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, Any, cast

from ...errors import StageError
from ...stage.back_ends import BACK_ENDS
from ...stage.description import Description
from .keeper import GOODBYE, HANDOVER, READY

_START = 30.0
"""Longest wait for a keeper to start and to open the stage [s]."""
_PER_TIMEOUT = 10
"""Number of heartbeats per time-out of the keeper."""


class _Steps:
    """The steps of the acquisition, which the keeper limits, and which the diagnostics report when one lasts long."""

    begun = math.inf
    """Begin of the present step on the clock of `time.monotonic` [s]; infinite outside a step."""

    def begin_step(self) -> None:
        """Note that a step begins now."""
        self.begun = time.monotonic()

    def end_step(self) -> None:
        """Note that the last step has ended."""
        self.begun = math.inf


class NoKeeper(_Steps):
    """Used instead of a `KeeperLink` for a stage without a keeper."""

    is_lost = has_stage = False

    def require(self) -> None:
        """Do nothing."""

    let_finish = require


class KeeperLink(_Steps):
    """The keeper process of this driver.

    Parameters
    ----------
    word : str
        Back end of the stage.
    values : mapping
        Values of the parameters of the back end, by name.
    sample_period : float
        Sample period of the driver [s].
    limits : Description
        Limits of the driver.
    ramp_rate : float
        Rate of the ramp to the safe voltage [V/s].
    timeout : float
        Time without a heartbeat after which the keeper acts [s].
    patience : float
        Longest duration of a step of the acquisition [s]; after this time the heartbeats end.
    locks : sequence of int
        Descriptors of the locks on the stage, which the keeper holds to its own end: while it moves the stage, no new
        driver may open it.

    Raises
    ------
    StageError
        If the keeper cannot be started, or cannot open the stage over a connection of its own.
    """

    def __init__(
        self,
        word: str,
        values: Mapping[str, Any],
        sample_period: float,
        limits: Description,
        ramp_rate: float,
        timeout: float,
        patience: float,
        locks: Sequence[int] = (),
    ) -> None:
        order = {
            "stage": word,
            "values": dict(values),
            "sample_period": sample_period,
            "limits": {name: getattr(limits, name) for name in ("voltage_min", "voltage_max", "max_slew_rate")},
            "ramp_rate": ramp_rate,
            "timeout": timeout,
            "ends_driver": BACK_ENDS[word].keeper_ends_driver,
            "driver": os.getpid(),
        }
        self._interval, self._ended, self._is_lost = timeout / _PER_TIMEOUT, threading.Event(), False
        self._patience = patience
        self.has_stage = False
        self._process = subprocess.Popen(
            [sys.executable, "-m", "piezo_hysteresis.acquisition.safety.keeper"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=_terminal(),
            pass_fds=locks,
            start_new_session=True,  # a signal to the driver's process group must not end its keeper
        )
        # Popen types its pipes as optional; with PIPE both exist
        self._orders = cast(IO[bytes], self._process.stdin)
        self._answers = cast(IO[bytes], self._process.stdout)
        self._pipe = self._orders.fileno()
        self._beats = threading.Thread(target=self._beat, name="heartbeat", daemon=True)
        try:
            answer = self._started(json.dumps(order))
            if answer != READY:
                raise StageError(
                    f"the keeper cannot hold the stage ({answer}), expected a second connection to it; free one, or "
                    "set keeper_timeout to 0 to go without a keeper"
                )
            os.set_blocking(self._pipe, False)
            self._beats.start()
        except BaseException:  # an interrupt, too: the keeper must not move the stage while this driver closes it
            self._ended.set()
            self._process.kill()
            self._process.wait()
            if self._beats.is_alive():
                self._beats.join()
            self._close_pipes()
            raise

    @property
    def is_lost(self) -> bool:
        """True if the keeper acts or has ended; this driver may then no longer drive the stage."""
        return self._is_lost or (not self._ended.is_set() and self._has_spoken())

    def _has_spoken(self) -> bool:
        """Whether the keeper has sent a message (it acts) or has ended."""
        return bool(select.select([self._answers], [], [], 0.0)[0])

    def require(self) -> None:
        """Raise StageError if the keeper acts or has ended."""
        if self.is_lost:
            raise StageError(
                "the keeper of the stage has ended: this driver was silent for too long, or the keeper was killed; "
                "configure again"
            )

    def let_finish(self) -> None:
        """Wait for the end of a keeper that acts, so that only one process sends commands."""
        if self.is_lost and not self.has_stage:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(self._patience)

    def close(self) -> None:
        """End the keeper, because the stage is safe; may be repeated."""
        if self._ended.is_set():
            with suppress(subprocess.TimeoutExpired):  # a keeper that was given the stage continues
                self._process.wait(1.0)
            return
        self._end(GOODBYE)
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._close_pipes()

    def hand_over(self, timeout: float) -> str:
        """Let the keeper bring the stage to its safe voltage; this driver has released it.

        Parameters
        ----------
        timeout : float
            Longest wait for the end of the keeper [s]; the keeper continues after this time.

        Returns
        -------
        str
            Result, as the last part of a message.
        """
        if self._ended.is_set() or self.is_lost:
            return "its keeper had ended before"
        self._end(HANDOVER)
        try:
            is_safe = self._process.wait(timeout) == 0
        except subprocess.TimeoutExpired:
            return f"its keeper has not reached the safe voltage within {timeout:g} s"
        finally:
            self._close_pipes()
        return f"its keeper {'then brought it' if is_safe else 'could not bring it'} to its safe voltage"

    def abandon(self) -> None:
        """Let the keeper act as if this driver had died, because a call of the stage does not return."""
        if not self._ended.is_set():
            self.has_stage = self._is_lost = True
            self._end(b"")
            self._close_pipes()

    def _end(self, last: bytes) -> None:
        self._ended.set()
        self._beats.join()
        self._send(last)

    def _close_pipes(self) -> None:
        self._orders.close()
        self._answers.close()

    def _started(self, order: str) -> str:
        self._send(f"{order}\n".encode())
        ready, _, _ = select.select([self._answers], [], [], _START)
        return self._answers.readline().decode(errors="replace").strip() if ready else f"no answer within {_START:g} s"

    def _beat(self) -> None:
        while not self._ended.wait(self._interval):
            if time.monotonic() - self.begun < self._patience:
                self._send(b".")

    def _send(self, text: bytes) -> None:
        try:
            os.write(self._pipe, text)
        except OSError:  # the pipe is closed or full: the keeper does not read
            self._is_lost = True


def _terminal() -> int | None:
    """Descriptor to which messages finally go: the keeper outlives threads of this process that forward messages."""
    if sys.stderr is None:  # the next file that the keeper opened would get the number 2, and its messages
        return subprocess.DEVNULL
    try:
        return sys.stderr.fileno()
    except ValueError:  # a stream in memory
        return None
