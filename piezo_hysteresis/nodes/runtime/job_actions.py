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

"""`JobActions`: the long jobs of a node as actions, where the package of their types is installed."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.task import Future
from std_srvs.srv import Trigger

from ...errors import reason_of
from ..messages.conversions import values_of
from .companion_node import companion_node
from .executor import spin_until
from .guarded_node import GuardedNode

INTERFACES = "piezo_hysteresis_interfaces"
"""Package of the types: optional, built by colcon beside this one."""

SUCCEEDED = ("done", "planned")
"""States of a job that ended well."""

SUFFIX = "_actions"
"""Suffix that makes the name of the action node from the name of the node."""

_EARLY = 0.01
"""Time between two checks whether the main node spins [s]."""
_CHECK_INTERVAL = 0.1
"""Time between two checks of a waiting goal whether the node ends [s]."""


class JobActions:
    """Actions under the name of a node, on their own node and threads.

    A goal waits for the end of its job in one thread, while another thread takes requests to cancel it. All operations
    on the job run in the thread of the node itself.

    Parameters
    ----------
    node : GuardedNode
        Node that runs the jobs.
    begin : mapping
        For each action the function that begins the job of a goal; it answers as a service does.
    abort : callable
        Ends the running job.
    ended : collection of str
        States in which a job has ended; those in `SUCCEEDED` mean success.
    result : callable
        Returns further fields of a result, by name, after a job has succeeded.
    """

    def __init__(
        self,
        node: GuardedNode,
        begin: Mapping[str, Callable[[Any], Trigger.Response]],
        abort: Callable[[], object],
        ended: Collection[str],
        result: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        self._main, self._begin, self._abort, self._ended, self._result = node, begin, abort, ended, result
        self._goal: queue.SimpleQueue[Any] | None = None
        self._is_over = Future()
        self._executor: MultiThreadedExecutor | None = None
        if find_spec(INTERFACES) is None:
            return
        types = import_module(f"{INTERFACES}.action")
        self._node = companion_node(node, SUFFIX)
        for name in begin:
            kind = getattr(types, name.capitalize())
            ActionServer(
                self._node,
                kind,
                f"{node.get_fully_qualified_name()}/{name}",
                execute_callback=partial(self._execute, name, kind),
                cancel_callback=self._cancel,
                callback_group=ReentrantCallbackGroup(),
            )
        self._executor = MultiThreadedExecutor(num_threads=3, context=node.context)
        self._executor.add_node(self._node)
        served = (self._executor, self._is_over, node)
        threading.Thread(target=spin_until, args=served, name="actions", daemon=True).start()

    def report(self, status: DiagnosticStatus) -> None:
        """Pass a status of the running job to the goal that began it."""
        goal = self._goal
        if goal is not None:
            if values_of(status)["state"] in self._ended:
                self._goal = None
            goal.put(status)

    def end(self) -> None:
        """End the waiting goal and the actions; may be repeated.

        A thread that continues to wait would keep the process from ending.
        """
        if not self._is_over.done():
            self._is_over.set_result(None)
        self._goal = None
        executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(timeout_sec=1.0)
            self._node.destroy_node()

    def _execute(self, name: str, kind: Any, handle: Any) -> Any:
        """Follow one goal to its end in a thread of the actions, and return the result in the type of the action."""
        reports: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._in_main(lambda: self._start(name, handle.request, reports))
        while True:
            report = self._next_of(reports)
            if isinstance(report, Trigger.Response):
                handle.abort()
                return kind.Result(success=False, message=report.message)
            values = {**values_of(report), "reason": report.message}
            if values["state"] in self._ended:
                break
            handle.publish_feedback(_filled(kind.Feedback, values))
        done = values["state"] in SUCCEEDED
        if done:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        result = _filled(kind.Result, {**values, **(self._result() if done else {})})
        result.success, result.message = done, report.message
        return result

    def _next_of(self, reports: queue.SimpleQueue[Any]) -> Any:
        """Wait for the next report of a job, which never comes where the node ends before the job has begun."""
        while not self._is_over.done():
            with suppress(queue.Empty):
                return reports.get(timeout=_CHECK_INTERVAL)
        return Trigger.Response(message=f"{self._main.get_name()} ends")

    def _start(self, name: str, goal: Any, reports: queue.SimpleQueue[Any]) -> None:
        try:
            response = self._begin[name](goal)
        except Exception as error:
            reports.put(Trigger.Response(message=reason_of(error)))
            raise
        if response.success:
            self._goal = reports
        else:
            reports.put(response)

    def _cancel(self, handle: Any) -> CancelResponse:
        self._in_main(self._abort)
        return CancelResponse.ACCEPT

    def _in_main(self, action: Callable[[], object]) -> None:
        """Call `action` in the thread of the main node, which may not spin yet where a goal arrives early."""
        while (executor := self._main.executor) is None:
            if self._is_over.done() or not self._main.context.ok():
                return
            time.sleep(_EARLY)
        executor.create_task(self._main.guarded(action))


def by_service(
    callback: Callable[[Trigger.Request, Trigger.Response], Trigger.Response],
) -> Callable[..., Trigger.Response]:
    """Adapt the callback of a service to a goal without fields."""
    return lambda *goal: callback(Trigger.Request(), Trigger.Response())


def _filled(kind: Any, values: Mapping[str, str]) -> Any:
    """A message of this type, filled from the values that have the name of a field."""
    fields = {name: text for name, text in kind.get_fields_and_field_types().items() if name in values}
    return kind(**{name: float(values[name]) if text == "double" else values[name] for name, text in fields.items()})
