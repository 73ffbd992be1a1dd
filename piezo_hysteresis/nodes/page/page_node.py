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

"""`page_node`: shows running axes in a browser; it only subscribes and calls services."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import Future as Reply

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidServiceNameException
from rclpy.validate_full_topic_name import validate_full_topic_name

from ...errors import ParameterError, printable
from ...parameter import Row, Setting, parts_of
from ...report.live.access import read_token
from ...report.live.axis_state import AxisState
from ...report.live.live_page import LivePage
from ...report.live.server import PageServer
from ...report.live.source import Answer
from ..runtime.guarded_node import GuardedNode
from ..runtime.parameters import declare, read
from ..runtime.process import run
from ..topics import DIAGNOSTICS, TOPICS, subscribe
from .axis_feed import AxisFeed, unsent

PAGE: tuple[Row, ...] = (
    Setting("address", "127.0.0.1", "address to listen on; one that other machines reach needs token_file"),
    Setting("port", 5006, "port to listen on; 0 takes a free one", lower=0, upper=65535),
    Setting("token_file", "", "file with the token that a visitor has to give; empty: none"),
    Setting("hosts", "", "further names, separated by commas, under which browsers reach the page"),
    Setting("axes", "", "namespaces to show, separated by commas; empty: every axis that publishes samples"),
)
"""Parameters of the page node, all read at start."""

_SEARCH_INTERVAL = 1.0
"""Time between two searches for new axes [s]."""

_MOST_AXES = 16
"""Largest number of axes that are found automatically."""


class PageNode(GuardedNode):
    """Source of the live page: topics, services and parameters stand in docs/ros."""

    def __init__(self) -> None:
        super().__init__("page_node")
        declare(self, PAGE, read_only=True)
        values = read(self, PAGE)
        self._feeds: dict[str, AxisFeed] = {}
        self._named = [namespace(axis) for axis in parts_of(values["axes"])]
        for axis in dict.fromkeys(self._named):
            self._follow(axis)
        subscribe(self, DIAGNOSTICS, self._on_diagnostics)
        self.create_timer(_SEARCH_INTERVAL, self._search, clock=Clock(clock_type=ClockType.STEADY_TIME))
        token = read_token(values["token_file"]) if values["token_file"] else ""
        self._server = PageServer(
            lambda document: LivePage(document, self),
            values["address"],
            values["port"],
            token,
            parts_of(values["hosts"]),
        )
        self.get_logger().info(f"open {self._server.url} in a browser")

    def end(self) -> None:
        """Stop serving pages."""
        self._server.close()

    def axes(self) -> Mapping[str, AxisState]:
        """The axes known so far, by name; from any thread."""
        return {name: feed.state for name, feed in sorted(self._feeds.items())}

    def call(self, axis: str, service: str) -> Reply[Answer]:
        """Call a service of an axis; from any thread."""
        feed = self._feeds.get(axis)
        return unsent(f"no axis '{axis}' was found yet; nothing was sent") if feed is None else feed.call(service)

    def _follow(self, axis: str) -> None:
        self._feeds = {**self._feeds, axis: AxisFeed(self, axis)}

    def _search(self) -> None:
        for feed in self._feeds.values():
            feed.expire()
        if self._named:
            return
        kind = TOPICS["samples"].type_name
        for name, kinds in self.get_topic_names_and_types():
            axis = name.removesuffix("samples").rstrip("/") or "/"
            is_new = axis not in self._feeds and len(self._feeds) < _MOST_AXES
            if name.endswith("/samples") and kind in kinds and is_new:
                self.get_logger().info(f"found the axis {axis}")
                self._follow(axis)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            any(feed.report(status) for feed in self._feeds.values())


def namespace(text: str) -> str:
    """Absolute name of a namespace, ``/`` for none.

    Raises
    ------
    ParameterError
        If it is none.
    """
    name = "/" + text.strip("/")
    try:
        validate_full_topic_name(f"{name.rstrip('/')}/model_node/plan_recalibration", is_service=True)
    except InvalidServiceNameException:
        raise ParameterError(f"axes: got '{printable(text)}', expected a namespace such as /stage_x") from None
    return name


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a page node; its exit code is 2 where its parameters are invalid or its port is in use."""
    return run(PageNode, arguments, end=PageNode.end)


if __name__ == "__main__":
    sys.exit(main())
