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

"""Show in one line on the terminal what the identification node of an axis does, until its job ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.signals import SignalHandlerOptions

from ..errors import printable
from .identification.status import ENDED, SUFFIX
from .messages.conversions import values_of
from .runtime.executor import make_executor
from .runtime.guarded_node import GuardedNode
from .topics import subscribe

_INTERVAL = 0.1
"""Time between two looks at the newest status [s]; a late joiner first receives old ones."""

_WIDTH = 110
"""Largest number of characters of a line; a longer line could not be overwritten."""


class Follower(GuardedNode):
    """Writes the newest status of the identification node of an axis.

    Parameters
    ----------
    namespace : str
        Namespace of the axis, e.g. ``/stage_x``.

    Attributes
    ----------
    exit_status : int or None
        None until a job ends that had not ended before; then 0 if it was done, and 1 if not.
    """

    def __init__(self, namespace: str) -> None:
        super().__init__("follow", namespace=namespace, start_parameter_services=False)
        self.exit_status: int | None = None
        self._newest: DiagnosticStatus | None = None
        self._ended_before: str | None = None
        self._line = ""
        status = subscribe(self, "status", self._on_status)
        self.create_timer(_INTERVAL, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._show(f"no message on {status.topic_name} yet; the identification node of this namespace has to run")

    def _on_status(self, status: DiagnosticStatus) -> None:
        if status.name.endswith(SUFFIX):
            self._newest = status

    def _look(self) -> None:
        """Show the newest status, and find out whether a job has ended since the first look."""
        if self._newest is None:
            return
        values = values_of(self._newest)
        state, goal = values.get("state", ""), values.get("goal", "")
        line = " ".join(
            part
            for part in (
                f"{self._newest.name.removesuffix(SUFFIX)}:",
                state,
                values.get("phase", ""),
                f"{values['percent']} %" if values.get("percent", "0") != "0" else "",
                self._newest.message,
            )
            if part
        )
        self._show(printable(line)[:_WIDTH])
        has_ended = state in ENDED
        if self._ended_before is None:
            self._ended_before = goal if has_ended else ""
        if has_ended and goal != self._ended_before:
            self.exit_status = int(state != "done")

    def _show(self, line: str) -> None:
        """Overwrite the last line on a terminal; elsewhere write a line for each change."""
        if line == self._line:
            return
        self._line = line
        if sys.stdout.isatty():
            sys.stdout.write(f"\r\033[K{line}")
        else:
            sys.stdout.write(f"{line}\n")
        sys.stdout.flush()


def main(arguments: Sequence[str] | None = None) -> int:
    """Follow an axis; returns 0 where its job succeeds, 1 where it fails or is aborted, 130 on Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    rclpy.init(args=given[1:], signal_handler_options=SignalHandlerOptions.NO)
    node = Follower(given[0] if given else "")
    executor = make_executor()
    executor.add_node(node)
    try:
        while node.exit_status is None:
            executor.spin_once(timeout_sec=0.2)
    except KeyboardInterrupt:
        return 130
    finally:
        if sys.stdout.isatty():
            sys.stdout.write("\n")
        executor.shutdown()
        rclpy.try_shutdown()
    return node.exit_status


if __name__ == "__main__":
    sys.exit(main())
