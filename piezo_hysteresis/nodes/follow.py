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

"""Show the `status` topics of an axis in one line on the terminal until the running job ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.signals import SignalHandlerOptions

from ..errors import printable
from .messages.conversions import values_of
from .runtime.executor import make_executor
from .runtime.guarded_node import GuardedNode
from .runtime.qos import LATCHED

ENDED = {"done": 0, "failed": 1, "aborted": 1, "refused": 1}
"""Last states of a job, with the exit code for each."""

_IDLE = ("idle", "")
"""States in which no job is running."""

_WIDTH = 110
"""Largest number of characters of a line; a longer line could not be overwritten."""


class Follower(GuardedNode):
    """Writes the newest status of an axis.

    Parameters
    ----------
    namespace : str
        Namespace of the axis, e.g. ``/stage_x``.
    """

    def __init__(self, namespace: str) -> None:
        super().__init__("follow", namespace=namespace, start_parameter_services=False)
        self.exit_status: int | None = None
        self._under_way = False
        self._line = ""
        status = self.create_subscription(DiagnosticStatus, "status", self._on_status, LATCHED)  # the newest is enough
        self._show(f"no message on {status.topic_name} yet; the identification node of this namespace has to run")

    def _on_status(self, status: DiagnosticStatus) -> None:
        values = values_of(status)
        state = values.get("state", "")
        line = " ".join(
            part
            for part in (
                f"{status.name.rpartition(': ')[0]}:",
                state,
                values.get("phase", ""),
                f"{values['percent']} %" if values.get("percent", "0") != "0" else "",
                status.message,
            )
            if part
        )
        self._show(printable(line)[:_WIDTH])
        if state in ENDED and self._under_way:
            self.exit_status = ENDED[state]
        self._under_way = self._under_way or state not in (*_IDLE, *ENDED)

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
