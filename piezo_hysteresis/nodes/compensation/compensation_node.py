"""`compensation_node`: sends the stage along a wanted displacement, through the inverse of the model and the driver."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from ...compensation import Limits
from ...errors import ModelError, PiezoError, StageError
from ...model.model import Model
from ...model.model_file import load, loads
from ...online.warmup import compile_kernels
from ...parameter import Parameter, Row, Setting
from ..identification.driver_client import DriverClient
from ..messages.phase_text import phase_name
from ..messages.samples import SampleReader
from ..runtime.guarded_node import GuardedNode
from ..runtime.parameters import declare, read
from ..runtime.process import run
from ..runtime.sending import send
from ..topics import advertise, subscribe
from .applied_state import AppliedState
from .path_runs import TICK, Job, PathRuns
from .set_point import SetPoint
from .status import CompensationStatus
from .trajectory import described, trajectory_from_cloud, why_not

_SOURCE = "compensation node"
"""Where the bounds of the parameters come from."""

COMPENSATION: tuple[Row, ...] = (
    Setting("model_file", "", "path of the first model; a model on the topic `model` replaces it between trajectories"),
    Setting("driver", "driver_node", "name of the driver node in the same namespace"),
    Setting("play", True, "false: a trajectory is planned and kept for ~/plan and ~/learn, nothing moves"),
    Setting("approximate", False, "leave out effects that cannot be turned round instead of refusing the model"),
    Setting("learning_rounds", 2, "corrections that ~/learn plays", lower=0, upper=100),
    Parameter("sensor_noise", "σ", "m", 0.0, 0.0, 1e-3, "rms noise of the sensor, at which learning stops", _SOURCE),
    Parameter("approach", "t_a", "s", 0.1, 1e-3, 1e3, "duration of the way to the first sample of a path", _SOURCE),
    Parameter("longest_trajectory", "t_max", "s", 120.0, 1e-3, 1e5, "longer ones are refused", _SOURCE),
    Parameter("integral_time", "t_i", "s", 0.0, 0.0, 1e6, "slow integral behind set_displacement; 0: off", _SOURCE),
)
"""Parameters of the node."""


class CompensationNode(GuardedNode):
    """Compensation of one axis: topics, services and parameters stand in docs/ros."""

    def __init__(self, **options: Any) -> None:
        super().__init__("compensation_node", **options)
        declare(self, COMPENSATION)
        self._values = read(self, COMPENSATION)
        compile_kernels()
        self._status = CompensationStatus(self)
        self._driver = DriverClient(self, self._values["driver"])
        self._error, self._rms = advertise(self, "tracking_error"), advertise(self, "tracking_rms")
        self._runs = PathRuns(self._driver, self._status, self._values, self._known)
        self._reader = SampleReader()
        self._model: Model | None = None
        self._applied: AppliedState | None = None
        self._job: Job | None = None
        self._phase = ""
        self._set_point = SetPoint(advertise(self, "set_voltage"), self._values["integral_time"])
        if self._values["model_file"]:
            self._follow_model(load(self._values["model_file"]))
        subscribe(self, "model", self._on_model)
        subscribe(self, "samples", self._on_samples, deep=True, raw=True)
        subscribe(self, "trajectory", self._on_trajectory)
        subscribe(self, "set_displacement", self._on_set_displacement)
        for name, callback in (("plan", self._on_plan), ("learn", self._on_learn), ("stop", self._on_stop)):
            self.create_service(Trigger, f"~/{name}", callback)
        self.create_timer(TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """Stop what is under way, while services still work."""
        if self._job is not None:
            self._give_up()
            asked = self._driver.stop()
            if asked is not None:
                self.executor.spin_until_future_complete(asked, timeout_sec=2.0)
        self._runs.close()

    def _on_model(self, message: String) -> None:
        try:
            self._follow_model(loads(message.data, "topic 'model'"))
        except PiezoError as error:
            self._status.refuse("model", str(error))

    def _follow_model(self, model: Model) -> None:
        """From the next trajectory on; the one that plays ends with the model that it was planned with."""
        self._model = model
        if self._job is None:
            self._applied = None

    def _on_samples(self, message: bytes) -> None:
        try:
            block = self._reader.read(message)
            if self._model is not None and self._applied is None:
                self._applied = AppliedState(self._model, block)
            elif self._applied is not None:
                self._applied.take(block)
            if self._runs.tracking is not None:
                self._runs.tracking.take(block)
        except PiezoError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=10.0)
            return
        self._set_point.measured(float(np.mean(block.displacement)), block.size)

    def _on_trajectory(self, cloud: PointCloud2) -> None:
        name = cloud.header.frame_id[:64]
        try:
            applied, limits = self._ready()
            name = phase_name(cloud.header.frame_id)
            wanted = trajectory_from_cloud(cloud, applied.model.sample_period, self._values["longest_trajectory"])
        except PiezoError as error:
            self._status.refuse(name, str(error))
            return
        self._set_point.leave()
        self._begin(name, self._runs.follow(name, wanted, limits))

    def _on_set_displacement(self, message: Float64) -> None:
        try:
            applied, limits = self._ready()
            found = self._runs.planned(np.full(16, float(message.data)), limits)
            if not found.reachability.is_whole:
                raise StageError(why_not(found))
        except PiezoError as error:
            self._status.refuse("set_displacement", str(error))
            return
        slope = (found.voltage[-1] - applied.voltage, found.predicted[-1] - found.predicted[0])
        self._set_point.go(float(message.data), float(found.voltage[-1]), slope, limits)
        self._status.show("set", f"{1e6 * message.data:.6g} µm by {found.voltage[-1]:.6g} V", "set_displacement")

    def _ready(self) -> tuple[AppliedState, Limits]:
        """What the model knows of the stage, and the limits of the driver.

        Raises
        ------
        PiezoError
            If something is missing, or a job is under way.
        """
        if self._job is not None:
            raise StageError(f"busy with '{self._phase}'; wait, or ~/stop first")
        if self._model is None:
            raise ModelError("no model yet; expected model_file, or a model on the topic 'model'")
        driver = self._driver.limits
        if driver is None or self._driver.missing:
            raise StageError(f"no driver: waiting for {self._driver.missing}")
        if self._applied is None:
            raise StageError("no samples yet; is the driver active?")
        self._applied.check_period(driver.sample_period)
        slew = driver.max_slew_rate * (1.0 - 1e-9)  # rounding shall not make a step that the driver refuses
        return self._applied, Limits(driver.voltage_min, driver.voltage_max, slew)

    def _known(self) -> AppliedState:
        assert self._applied is not None
        return self._applied

    def _begin(self, phase: str, job: Job) -> None:
        self._phase, self._job = phase, job

    def _tick(self) -> None:
        tracking = self._runs.tracking
        if tracking is not None and (error := tracking.newest_error) is not None:
            send(self._error, Float64(data=error))
            send(self._rms, Float64(data=tracking.rms or 0.0))
        self._set_point.tick(TICK)
        if self._job is None:
            return
        try:
            next(self._job)
        except StopIteration:
            self._finish()
        except PiezoError as error:
            self._finish()
            self._status.failed(self._phase, str(error))

    def _finish(self) -> None:
        self._job, self._runs.tracking = None, None
        if self._applied is not None and self._model is not self._applied.model:
            self._applied = None  # the new model takes over with the next block

    def _give_up(self) -> None:
        if self._job is not None:
            self._job.close()
        self._finish()

    def _on_plan(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._runs.last is None:
            response.message = "no trajectory yet: publish one on 'trajectory' (with play: false nothing moves)"
            return response
        name, found = self._runs.last
        response.success, response.message = found.reachability.is_whole, f"{name}: {described(found)}"
        return response

    def _on_learn(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            _, limits = self._ready()
            if self._runs.last is None:
                raise StageError("no trajectory yet: publish one on 'trajectory' first")
            name, found = self._runs.last
            if not found.reachability.is_whole:
                raise StageError(why_not(found))
        except PiezoError as error:
            response.message = str(error)
            return response
        self._set_point.leave()
        self._begin(name, self._runs.rounds(name, found, limits))
        response.success, response.message = True, f"{1 + self._values['learning_rounds']} rounds of '{name}' at most"
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._set_point.leave()
        asked = self._driver.stop()
        if self._job is not None:
            self._give_up()
        self._status.show("stopped", "on request; the driver goes to its safe voltage", self._phase)
        response.success = asked is not None
        response.message = "stopped; the driver goes to its safe voltage" if asked else "there is no driver to stop"
        return response


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a compensation node; its exit code is 2 where its parameters make no sense."""
    return run(CompensationNode, arguments, end=CompensationNode.end)


if __name__ == "__main__":
    sys.exit(main())
