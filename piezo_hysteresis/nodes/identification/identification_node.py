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

"""`identification_node`: plays a protocol, records it, fits it in another process, and serves the model."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from uuid import uuid4

from rclpy.clock import Clock, ClockType
from std_srvs.srv import Trigger

from ...acquisition.stage_lock import StageLock
from ...discrepancy.choice.tiers import whole_plan
from ...effects import HYSTERESIS, Arx, Offset
from ...errors import PiezoError, reason_of
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.protocol import Protocol
from ...model.model import Model
from ...model.model_file import dumps, loads
from ...recording.segmentation.decimation import save_decimation
from ..runtime.fit_process import FitProcess, Job, Outcome
from ..runtime.guarded_node import GuardedNode
from ..runtime.job_actions import JobActions, by_service
from ..runtime.parameters import declare, node_name, read
from ..runtime.process import run
from .driver_client import DriverClient
from .experiment_folder import ExperimentFolder, problem_of_saving
from .fit_jobs import diagnosis, identification
from .live_process import LiveSettings
from .live_protocols import LiveProtocols
from .parameter_check import ParameterCheck
from .protocol_runner import PATIENCE, Progress, run_protocol, run_protocols
from .served_model import ServedModel
from .settings import IDENTIFICATION, PROTOCOLS
from .status import ENDED, IdentificationStatus

START = Model((HYSTERESIS(), Arx(), Offset()), 2e-5)
"""Model whose parameters are declared, as not valid, before there is a result."""

_TICK = 0.02
"""Time between two steps of the running job [s]."""


class IdentificationNode(GuardedNode):
    """Identification of one axis: topics, services and parameters stand in docs/ros."""

    def __init__(self) -> None:
        super().__init__("identification_node", allow_undeclared_parameters=True)
        declare(self, IDENTIFICATION)
        read(self, IDENTIFICATION)
        driver = self.resolve_topic_name(node_name("driver", self._value("driver")))
        self._lock = StageLock([f"the identification of {driver} in domain {self.context.get_domain_id()}"])
        self._status = IdentificationStatus(self)
        self._driver = DriverClient(self, self._value("driver"))
        self._job: Generator[Progress] | None = None
        self._moves = False
        self._folder = ExperimentFolder(self._value("experiment_root"), self.get_namespace())
        self._served = ServedModel(self, START)
        try:
            self._served.resume({name: p.value for name, p in self._parameter_overrides.items()})
        except PiezoError as error:
            self._status.failed(f"no model from the parameters: {error}")
        self.add_on_set_parameters_callback(ParameterCheck(self._folder, self.has_parameter))
        for name, callback in (
            ("plan", self._on_plan),
            ("identify", self._on_identify),
            ("diagnose", self._on_diagnose),
            ("abort", self._on_abort),
        ):
            self.create_service(Trigger, f"~/{name}", callback)
        begin = {"identify": by_service(self._on_identify), "diagnose": by_service(self._on_diagnose)}
        self._actions = JobActions(self, begin, by_service(self._on_abort), ENDED, self._result)
        self._status.listener = self._actions.report
        self.create_timer(_TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """Abort the running job while services still work."""
        self._lock.release()
        self._actions.end()
        if self._job is not None:
            self._end_job()
            asked = self._driver.stop() if self._driver.owns else None
            if asked is not None:
                self.executor.spin_until_future_complete(asked, timeout_sec=2.0)

    def _on_plan(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._driver.limits is None or not self._driver.is_fresh:
            response.message = f"no limits: waiting for {self._driver.missing}"
            return response
        try:
            protocol = self._planned(self._driver.limits)
        except PiezoError as error:
            response.message = str(error)
            return response
        response.success, response.message = True, f"{protocol.name}: {protocol.summary}"
        return response

    def _on_identify(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._on_drive(response, self._identify)

    def _on_drive(self, response: Trigger.Response, job: Callable[[Path], Generator[Progress]]) -> Trigger.Response:
        """Begin a job that moves the stage, unless it is already known to be impossible."""
        path = self._folder.new()
        message = f"recording to {path}"
        if self._driver.missing:
            message = f"waiting up to {PATIENCE:g} s for {self._driver.missing}; then {message}"
        elif self._job is None and self._driver.blocked:
            response.message = self._driver.blocked
            return response
        if self._driver.is_fresh and self._driver.limits is not None:
            try:
                self._planned(self._driver.limits)
            except PiezoError as error:
                response.message = str(error)
                return response
        return self._begin(response, job(path), message)

    def _on_diagnose(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if read(self, IDENTIFICATION)["live"]:
            return self._on_drive(response, self._diagnose_live)
        path = self._folder.chosen(self._value("experiment"))
        if path is None or not path.exists():
            where = f"in {self._folder.root}" if path is None else str(path)
            response.message = f"no experiment {where}; set 'experiment', or identify first"
            return response
        return self._begin(response, self._fit(diagnosis, path), f"diagnosing {path}")

    def _on_abort(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._job is None:
            response.message = "nothing is under way"
            return response
        self._status.aborted(self._end_job())
        response.success, response.message = True, "aborted"
        return response

    def _begin(self, response: Trigger.Response, job: Generator[Progress], message: str) -> Trigger.Response:
        if self._job is not None:
            job.close()
            response.message = "busy; wait, or abort first"
            return response
        self._job, self._status.goal, self._status.likely = job, uuid4().hex, ""
        self.get_logger().info(message)
        response.success, response.message = True, f"{message}; goal {self._status.goal}"
        return response

    def _result(self) -> dict[str, str]:
        """Result of the last job, for clients of an action."""
        answer = Path(self._status.experiment) / "answer.json"
        model = self._served.model
        return {
            "model": "" if model is None else dumps(model),
            "answer": answer.read_text(encoding="utf-8") if answer.is_file() else "",
        }

    def _tick(self) -> None:
        if self._job is None:
            return
        try:
            self._status.progress(next(self._job))
        except StopIteration:
            self._job = None
        except Exception as error:
            self._job = None
            if not isinstance(error, PiezoError):
                self.fault(error)
            self._status.failed(reason_of(error))

    def _end_job(self) -> str:
        """End the running job. Returns a sentence about the stage and the recording."""
        job, self._job = self._job, None
        owned = self._driver.owns
        try:
            if job is not None:
                job.close()
        except Exception as error:
            return f"on request; {reason_of(error)}"
        if owned:
            return "on request; the driver was asked to go to its safe voltage, the recording is readable"
        ended = "nothing was played" if self._moves else "the fit was ended"
        return f"on request; {ended}, the stage was left as it is"

    def _identify(self, path: Path) -> Generator[Progress]:
        planned: list[Protocol] = []

        def plan(limits: DriveLimits) -> Protocol:
            planned.append(self._protocol(limits))
            return planned[0]

        self._moves = True
        self._status.experiment, self._status.owner = str(path), self._driver.owner
        yield from run_protocol(self, self._driver, plan, path)
        save_decimation(path, [(phase.name, phase.stored_every) for phase in planned[0]])
        self._folder.last = path
        yield from self._fit(identification, path)

    def _fit(self, job: Job[Outcome], path: Path) -> Generator[Progress]:
        self._moves = False
        self._status.experiment, self._status.owner = str(path), ""
        model = self._served.model
        process = FitProcess(job, path, "" if model is None else dumps(model))
        try:
            while (outcome := process.poll()) is None:
                word, fraction = process.progress
                yield Progress("fitting", word, fraction)
        finally:
            process.close()
        self._accept(outcome, path, job.__name__)

    def _diagnose_live(self, path: Path) -> Generator[Progress]:
        self._moves = True
        self._status.experiment, self._status.owner = str(path), self._driver.owner
        settings = LiveSettings.from_values(read(self, IDENTIFICATION))
        protocols = LiveProtocols(path, settings, self._status.set_likely)
        try:
            yield from run_protocols(self, self._driver, protocols.following, path)
        finally:
            protocols.close()
        self._folder.last, self._moves, self._status.owner = path, False, ""
        self._accept(protocols.outcome, path, diagnosis.__name__)

    def _accept(self, outcome: Outcome, path: Path, name: str) -> None:
        """Serve, publish and save the model of a job that has ended."""
        found = loads(outcome.model)
        self._served.serve(found)
        problem = problem_of_saving(found, (path if path.is_dir() else path.parent) / f"{name}.yaml")
        for line in outcome.summary.splitlines():
            self.get_logger().info(line)
        self._status.done(outcome.verdict + problem, outcome.conclusion)

    def _protocol(self, limits: DriveLimits) -> Protocol:
        values = read(self, IDENTIFICATION)
        return PROTOCOLS[values["protocol"]](limits, values["seed"])

    def _planned(self, limits: DriveLimits) -> Protocol:
        """What ~/plan describes: the protocol, or with `live` all phases of a live diagnosis in their fixed order."""
        values = read(self, IDENTIFICATION)
        return whole_plan(limits, values["seed"]) if values["live"] else self._protocol(limits)

    def _value(self, name: str) -> str:
        return str(self.get_parameter(name).value)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an identification node; its exit code is 2 where its parameters are invalid."""
    return run(IdentificationNode, arguments, end=IdentificationNode.end)


if __name__ == "__main__":
    sys.exit(main())
