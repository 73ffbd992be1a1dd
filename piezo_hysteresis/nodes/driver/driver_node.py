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

"""`driver_node`: drives one stage, publishes every sample, and plays commands after a complete check."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from ...acquisition.safety.stop_latch import StopLatch
from ...acquisition.session import DriverSession
from ...acquisition.settings import DRIVER, DriverSettings
from ...errors import PiezoError, StageError, reason_of
from ...record import Record
from ...stage.back_ends import BACK_ENDS
from ..messages.frame import frame_name
from ..runtime.guarded_node import GuardedNode
from ..runtime.node_clock import now
from ..runtime.parameters import read
from ..runtime.process import run
from .commands import DriverCommands
from .diagnostics import DriverDiagnostics
from .parameters import DriverParameters, refuse_simulated_time
from .publishers import DriverTopics
from .second_driver import refuse_second_driver


class DriverNode(GuardedNode, LifecycleNode):
    """Driver of one axis: topics, services and parameters stand in docs/ros.

    Parameters
    ----------
    **options
        As for `rclpy.node.Node`.

    Raises
    ------
    PiezoError
        Where `use_sim_time` is set, or another process has a driver of this name.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("driver_node", **options)
        refuse_simulated_time(self)
        self.hold_name()
        self._session: DriverSession | None = None
        self._topics: DriverTopics | None = None
        self._failure: PiezoError | None = None
        self._latch = StopLatch()
        self._own_parameters = DriverParameters(self, self._latch, lambda: self._session is not None)
        self._diagnostics = DriverDiagnostics(self, self._latch)
        self._commands = DriverCommands(self, self._diagnostics, self._latch, self._latch_changed)

    def begin(self) -> None:
        """Configure and activate where `autostart` asks for it; after a failure both can be tried again."""
        if self.get_parameter("autostart").value and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def end(self) -> None:
        """Ramp to the safe voltage and release the stage while publishers still work."""
        if self._state_machine.current_state[1] == "active":
            self.trigger_deactivate()
        if self._state_machine.current_state[1] in ("unconfigured", "inactive"):
            self.trigger_shutdown()
        self._commands.end()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the stage; on failure the node stays unconfigured and logs the reason."""
        try:
            driver = read(self, DRIVER)
            settings = DriverSettings.from_values(driver)
            frame = frame_name(driver["frame_id"], self.get_namespace())
            values = read(self, BACK_ENDS[settings.stage].rows, f"{settings.stage}.")
            place = f"{self.resolve_topic_name('samples')} of domain {self.context.get_domain_id()}"
            session = DriverSession(settings, values, place, _records, self._latch)
            with ExitStack() as undo:
                undo.callback(session.close)
                refuse_second_driver(self, settings.discovery_time)
                topics = DriverTopics(self, session.limits.name, frame, session.sample_period, settings.live_rate)
                undo.callback(topics.destroy)
                undo.callback(self._own_parameters.clear_in_force)
                self._own_parameters.publish_in_force(session.in_force())
                undo.pop_all()
        except Exception as error:  # rclpy would end the transition without a message
            self._report_failure(error)
            return TransitionCallbackReturn.FAILURE
        self._session = session
        self._topics = topics
        self._commands.attach(session, topics)
        self._diagnostics.state(DiagnosticStatus.OK, "configured, not active", session.limits.name)
        self.get_logger().info(f"configured: {session.limits.name}, {1 / session.sample_period:g} samples per second")
        for notice in session.notices:
            self.get_logger().warning(notice)
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to publish samples."""
        session = self._session
        topics = self._topics
        if topics is None or session is None:
            self._report_failure(StageError("activate: got no open stage, expected one; configure the driver first"))
            return TransitionCallbackReturn.FAILURE
        done = super().on_activate(state)
        self._failure = None
        topics.restart()
        try:
            acquisition = session.start(
                node_clock=lambda: now(self),
                deliver=topics.deliver,
                fail=lambda error: self._fail(session, error),
                subscribers=lambda: topics.subscribers,
            )
        except Exception as error:
            self._report_failure(error)
            super().on_deactivate(state)
            return TransitionCallbackReturn.FAILURE
        self._diagnostics.watch(acquisition, session.settings.real_time_factor / session.sample_period)
        self._diagnostics.state(DiagnosticStatus.OK, "streaming", session.limits.name)
        self.get_logger().info("active: samples flow")
        return done

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ramp to the safe voltage, then stop the samples; an error if the stage was not seen there."""
        self._diagnostics.watch(None)
        session = self._session
        has_failed = self._failure is not None
        try:
            if session is not None:
                session.make_safe()
        except Exception as error:
            self._report_failure(error)
            has_failed = True
        done = super().on_deactivate(state)
        if has_failed:
            return TransitionCallbackReturn.ERROR
        where = "" if session is not None and session.limits.ignores_drive else ": the stage is at its safe voltage"
        self.get_logger().info(f"not active any more{where}")
        self._diagnostics.state(DiagnosticStatus.OK, "configured, not active", session.limits.name if session else "")
        return done

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the stage."""
        self._release()
        self._diagnostics.state(DiagnosticStatus.STALE, "not configured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the stage to its safe voltage and release it."""
        self._release()
        self.get_logger().info("shut down")
        self._diagnostics.state(DiagnosticStatus.STALE, "shut down")
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the stage to its safe voltage and release it. The node is then unconfigured."""
        self._release()
        super().on_error(state)
        return TransitionCallbackReturn.SUCCESS

    def _release(self) -> None:
        self._commands.detach()
        self._diagnostics.watch(None)
        session, self._session = self._session, None
        topics, self._topics = self._topics, None
        ends = [self._own_parameters.clear_in_force]
        if session is not None:
            ends.append(session.close)
        for end in ends:
            try:
                end()
            except Exception as error:
                self._report_failure(error)
        if topics is not None:
            topics.destroy()

    def _fail(self, session: DriverSession, error: PiezoError) -> None:
        """Leave the active state in the thread of the executor, because the thread of the acquisition has ended."""
        self._report_failure(error)
        if session is not self._session:
            return  # it has been released: a call of its stage returned too late
        self._failure = error
        self.executor.create_task(self.guarded(self._give_up))

    def _give_up(self) -> None:
        if self._state_machine.current_state[1] == "active":
            self.trigger_deactivate()

    def _latch_changed(self) -> None:
        """Publish in the thread of the executor that the driver was stopped or released."""
        if self.executor is not None:
            self.executor.create_task(self.guarded(self._publish_latch))

    def _publish_latch(self) -> None:
        self._own_parameters.publish_in_force({"stopped": self._latch.is_set})
        self._diagnostics.publish()

    def _report_failure(self, error: Exception) -> None:
        reason = reason_of(error)
        self.get_logger().error(reason)
        self._diagnostics.state(DiagnosticStatus.ERROR, reason)


def _records(path: str) -> tuple[Record, ...]:
    from ... import recording  # only for a replay, and slow to import

    return recording.read(path).records


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a driver; its exit code is 2 where its parameters are invalid."""
    return run(DriverNode, arguments, begin=DriverNode.begin, end=DriverNode.end)


if __name__ == "__main__":
    sys.exit(main())
