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

"""`keeper`: a process that brings a stage to its safe voltage when the heartbeats of its driver end. No ROS.

The driver starts it (`KeeperLink`). The driver sends a line of JSON on standard input, which states how to open the
stage, and then a byte at regular intervals (the heartbeat). The keeper opens the stage over its own connection, without
moving it, answers ``ready``, and does nothing while bytes arrive. If nothing reports the voltage of the stage, the
keeper moves nothing when it has to act, and asks for the amplifier to be switched off.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from ...errors import PiezoError, UnknownVoltageError, reason_of
from ...stage.back_ends import BACK_ENDS
from ...stage.opening import Opening
from ...stage.stage import Stage

READY = "ready"
"""Answer of the keeper when it has opened the stage."""
ACTING = "acting"
"""Message of the keeper to a driver that may no longer use the stage."""
GOODBYE = b"q"
"""Sent by a driver that has made its stage safe itself."""
HANDOVER = b"h"
"""Sent by a driver that has released its stage and could not make it safe."""
_HANDED_OVER = "the driver could not make the stage safe"
"""Reason why a keeper acts after a handover."""
ATTEMPTS = 5
"""Number of attempts to bring the stage to its safe voltage."""
_BETWEEN_ATTEMPTS = 0.2
"""Time between two attempts [s]."""
_STDERR = 2
"""File descriptor of the messages."""
_LONGEST_REPORT = 0.2
"""Longest wait until a message has been written [s]; a paused terminal takes none."""
_UNKNOWN = "the voltage of the stage is unknown; switch the amplifier off by hand: the device may hold its output"
"""End of the report of a keeper that has not made its stage safe."""


def main() -> int:
    """Run the keeper of one stage. Returns 1 if it could not open the stage or make it safe, otherwise 0."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the driver itself makes the stage safe and ends the keeper
    line = sys.stdin.readline()
    if not line:
        return 0  # the driver ended before it named the stage
    order = json.loads(line)
    stage: Stage | None = None
    try:
        stage = _opened(order)
    except UnknownVoltageError:
        _report("neither the device nor a monitor reports the voltage; without the driver the stage keeps its voltage")
    except PiezoError as error:
        print(f"{' '.join(str(error).split())}", flush=True)  # noqa: T201  # the answer to the driver
        return 1
    try:
        print(READY, flush=True)  # noqa: T201  # the answer to the driver
    except BrokenPipeError:
        os._exit(0)  # the driver has ended; it moves nothing before the keeper has answered
    reason = _listen(order["timeout"])
    if not reason:
        os._exit(0)  # closing the stage would move it
    with suppress(BrokenPipeError):
        print(ACTING, flush=True)  # noqa: T201  # a driver that continues after a silence must not use the stage
    if stage is None:
        _report(f"{reason}; {_UNKNOWN}")
        return 1
    _report(f"{reason}; bringing {stage.description.name} to its safe voltage")
    if order["ends_driver"] and reason != _HANDED_OVER:
        with suppress(OSError):  # the driver has ended, and its number may belong to another process
            os.kill(order["driver"], signal.SIGKILL)
    return _make_safe(stage, order)


def _opened(order: Mapping[str, Any]) -> Stage:
    stage = BACK_ENDS[order["stage"]].open(order["values"], Opening(order["sample_period"], assumes_voltage=False))
    stage.restrict(replace(stage.description, **order["limits"]), order["ramp_rate"])
    return stage


def _listen(timeout: float) -> str:
    """Wait for the end of the heartbeats, and return its reason; empty if the driver ended them on purpose."""
    heard, descriptor = b"", sys.stdin.fileno()
    while not heard.endswith(GOODBYE):
        ready, _, _ = select.select([descriptor], [], [], timeout)
        if not ready:
            return f"the driver was silent for {timeout:g} s"
        heard = os.read(descriptor, 4096)
        if not heard:
            return "the driver has died"
        if heard.endswith(HANDOVER):
            return _HANDED_OVER
    return ""


def _make_safe(stage: Stage, order: Mapping[str, Any]) -> int:
    time.sleep(stage.description.latency)  # the device first plays the samples in its buffer
    for _ in range(ATTEMPTS):
        try:
            if order["ends_driver"]:  # only the driver had used the device: read the present voltage first
                stage = _opened(order)
            stage.safe()
        except BaseException as error:  # whatever failed, the next attempt may reach the safe voltage
            _report(reason_of(error))
            time.sleep(_BETWEEN_ATTEMPTS)
        else:
            _report(f"{stage.description.name} is at its safe voltage")
            return 0
    _report(f"{stage.description.name} could not be brought to its safe voltage; {_UNKNOWN}")
    return 1


def _report(text: str) -> None:
    """Write a line to stderr. It is lost if its reader has ended or stands still: the stage does not wait for it."""
    line = f"keeper: {' '.join(text.split())}\n".encode(errors="backslashreplace")

    def write() -> None:
        with suppress(OSError):
            os.write(_STDERR, line)

    writer = threading.Thread(target=write, name="report", daemon=True)
    writer.start()
    writer.join(_LONGEST_REPORT)


if __name__ == "__main__":
    sys.exit(main())
