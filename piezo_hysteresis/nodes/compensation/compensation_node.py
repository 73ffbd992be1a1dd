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

"""`compensation_node`: drives the stage along a wanted displacement, by the inverse of the model."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from ...compensation import Limits
from ...errors import ModelError, PiezoError, StageError, reason_of
from ...online.warmup import compile_kernels
from ..identification.driver_client import DriverClient
from ..messages.conversions import phase_text_of, values_of
from ..messages.phase_text import phase_name
from ..messages.samples import SampleReader
from ..runtime.guarded_node import GuardedNode
from ..runtime.job_actions import JobActions, by_service
from ..runtime.parameters import declare, node_name, read
from ..runtime.process import run
from ..runtime.sending import send
from ..topics import advertise, subscribe
from .applied_state import AppliedState
from .followed_model import FollowedModel
from .job import TICK, Job
from .path_runs import PathError, PathRuns
from .set_point import SetPoint, volts_per_metre
from .settings import COMPENSATION
from .status import ENDED, CompensationStatus
from .trajectory import described, doubt, trajectory_from_cloud, trajectory_to_cloud, why_not

_TO_SAFETY = "the driver goes to its safe voltage"
"""Effect of a stop in a status."""


class CompensationNode(GuardedNode):
    """Compensation of one axis: topics, services and parameters stand in docs/ros."""

    def __init__(self, **options: Any) -> None:
        super().__init__("compensation_node", **options)
        self.hold_name()
        declare(self, COMPENSATION, read_only=True)
        self._values = read(self, COMPENSATION)
        compile_kernels(self.get_logger().info)
        self._status = CompensationStatus(self)
        self._driver = DriverClient(self, node_name("driver", self._values["driver"]))
        self._error = advertise(self, "tracking_error")
        self._rms = advertise(self, "tracking_rms")
        self._runs = PathRuns(self._driver, self._status, self._values)
        self._job: Job | None = None
        self._phase = ""
        self._frame = ""
        self._reader = SampleReader()
        self._set_point = SetPoint(advertise(self, "set_voltage"), self._values["integral_time"])
        self._model = FollowedModel(self, self._values["model_file"], self._status, lambda: self._job is not None)
        subscribe(self, "samples", self._on_samples, deep=True, raw=True)
        subscribe(self, "trajectory", self._on_trajectory)
        subscribe(self, "set_displacement", lambda message: self._move_to(message.data))
        for name, callback in (("plan", self._on_plan), ("learn", self._on_learn), ("stop", self._on_stop)):
            self.create_service(Trigger, f"~/{name}", callback)
        self._actions = JobActions(self, {"track": self._on_goal}, by_service(self._on_stop), ENDED)
        self._status.listener = self._on_status
        self.create_timer(TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """End the running job while services still work, and let the driver end what this node plays or holds."""
        self._actions.end()
        drives = self._runs.tracking is not None or self._set_point.is_holding
        self._set_point.leave()
        self._give_up()
        asked = self._driver.stop() if drives else None
        if asked is not None:
            self.executor.spin_until_future_complete(asked, timeout_sec=2.0)

    def _on_samples(self, message: bytes) -> None:
        try:
            block = self._reader.read(message)
            self._frame = block.frame
            self._model.take(block, self._driver.limits)
            if self._runs.tracking is not None:
                self._runs.tracking.take(block)
        except PiezoError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=10.0)
            return
        self._set_point.measured(float(np.mean(block.displacement)), block.size)

    def _on_trajectory(self, cloud: PointCloud2) -> Trigger.Response:
        name = phase_text_of(cloud, self._frame)
        try:
            applied, limits = self._ready()
            name = phase_name(name)
            wanted = trajectory_from_cloud(cloud, applied.sample_period, self._values["longest_trajectory"])
        except PiezoError as error:
            self._status.refuse(name[:64], str(error))
            return Trigger.Response(message=str(error))
        self._set_point.leave()
        self._phase = name
        self._job = self._runs.follow(name, applied, wanted, limits)
        return Trigger.Response(success=True)

    def _on_goal(self, goal: Any) -> Trigger.Response:
        return self._on_trajectory(trajectory_to_cloud(goal.displacement, goal.phase, self.get_clock().now().to_msg()))

    def _on_status(self, status: DiagnosticStatus) -> None:
        if self._job is None or values_of(status)["state"] != "refused":  # this path was not refused, another one was
            self._actions.report(status)

    def _move_to(self, target: float) -> None:
        """Move the stage to a displacement [m] and hold it there."""
        try:
            applied, limits = self._ready(moves=True)
            if not applied.is_ready:
                raise ModelError("the new model is being run over the applied voltages; send it again in a moment")
            found = self._runs.planned(applied, np.full(16, target), limits, way_back=False)
            if not found.reachability.is_whole:
                raise StageError(why_not(found))
            slope = volts_per_metre(applied.model, limits)
        except PiezoError as error:
            self._status.refuse("set_displacement", str(error))
            return
        voltage = float(found.voltage[-1])
        self._set_point.go(target, voltage, slope, limits, in_motion=not applied.is_held)
        self._status.show("set", f"{1e6 * target:.6g} µm by {voltage:.6g} V{doubt(found)}", "set_displacement")

    def _ready(self, moves: bool = False) -> tuple[AppliedState, Limits]:
        """The state of the model, and the limits of the driver.

        Raises
        ------
        PiezoError
            If something is missing, or a job is running.
        """
        if moves and not self._values["play"]:
            raise StageError("nothing moves, because the parameter 'play' is false")
        if self._job is not None:
            raise StageError(f"busy with '{self._phase}'; wait, or ~/stop first")
        driver = self._driver.limits
        if driver is None or self._driver.missing:
            raise StageError(f"no driver: waiting for {self._driver.missing}")
        if self._driver.blocked:
            raise StageError(self._driver.blocked)
        applied = self._model.ready(driver)
        slew = driver.max_slew_rate * (1.0 - 1e-9)  # rounding must not cause a step that the driver refuses
        return applied, Limits(driver.voltage_min, driver.voltage_max, slew)

    def _tick(self) -> None:
        tracking = self._runs.tracking
        if tracking is not None and (error := tracking.newest_error) is not None:
            send(self._error, Float64(data=error))
            send(self._rms, Float64(data=tracking.rms or 0.0))
        self._set_point.hold(TICK, self._driver, self._status.lost)
        applied = self._model.applied
        if applied is not None and (target := self._set_point.to_plan_again(applied.is_held)) is not None:
            self._move_to(target)
        if self._job is None:
            return
        try:
            next(self._job)
        except StopIteration:
            self._finish()
        except Exception as error:
            asked = self._driver.stop() if self._runs.is_driving else None
            self._finish()
            refused = isinstance(error, PathError) or self._driver.state == "refused"
            report = self._status.refuse if refused else self._status.failed
            report(self._phase, f"{reason_of(error)}; {_TO_SAFETY}" if asked else reason_of(error))
            if not isinstance(error, PiezoError):
                raise

    def _finish(self) -> None:
        self._job = None
        self._runs.tracking = None
        self._model.catch_up()

    def _give_up(self) -> None:
        if self._job is not None:
            self._job.close()
        self._finish()

    def _on_plan(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._runs.last is None:
            response.message = "no trajectory yet: publish one on 'trajectory' (with play: false nothing moves)"
            return response
        name, found = self._runs.last
        response.success = found.reachability.is_whole
        response.message = f"{name}: {described(found)}"
        return response

    def _on_learn(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            applied, limits = self._ready(moves=True)
            if self._runs.last is None:
                raise StageError("no trajectory yet: publish one on 'trajectory' first")
            name, found = self._runs.last
            if not found.reachability.is_whole:
                raise StageError(why_not(found))
        except PiezoError as error:
            response.message = str(error)
            return response
        self._set_point.leave()
        self._phase = name
        self._job = self._runs.rounds(name, applied, found, limits)
        response.success = True
        response.message = f"{1 + self._values['learning_rounds']} rounds of '{name}' at most"
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        held = "set_displacement" if self._set_point.is_holding else ""
        ended = held if self._job is None else self._phase
        asked = self._driver.stop()
        self._set_point.leave()
        if self._job is not None:
            self._give_up()
        effect = _TO_SAFETY if asked else "there is no driver to stop"
        self._status.show("stopped", f"on request; {effect}", ended)
        response.success = asked is not None
        response.message = f"stopped; {effect}" if asked else effect
        return response


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a compensation node; its exit code is 2 where its parameters are invalid."""
    return run(CompensationNode, arguments, end=CompensationNode.end)


if __name__ == "__main__":
    sys.exit(main())
