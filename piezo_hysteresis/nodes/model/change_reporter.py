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

"""`ChangeReporter`: the change watch of a model node: `~/baseline`, the topic `change`, its line on /diagnostics."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_srvs.srv import Trigger

from ...acquisition.sample_block import SampleBlock
from ...errors import PiezoError
from ...home_path import in_home
from ...model.model import Model
from ...model.model_parameters import model_hash
from ...online.change.baseline import Baseline
from ...online.change.score import GROUPS, UNITS
from ...online.change.watch import ChangeWatch, baseline_path
from ...online.prediction import Prediction
from ...online.predictor import Predictor
from ...parameter import Parameter, Row, Setting
from ..messages.conversions import diagnostic
from ..runtime.sending import send
from ..topics import advertise

_SOURCE = "change watch"
"""Source of the parameters of the change watch."""

CHANGE: tuple[Row, ...] = (
    Parameter(
        "false_alarm_interval",
        "T_fa",
        "s",
        86400.0,
        60.0,
        1e8,
        "mean time between false alarms of the change watch",
        _SOURCE,
    ),
    Parameter("baseline_time", "T_bl", "s", 60.0, 10.0, 1e5, "time over which ~/baseline is taken", _SOURCE),
    Setting(
        "baseline_folder",
        "",
        "folder of baselines, recalibrated models and their history; empty: ~/.ros/piezo_hysteresis/<namespace>",
    ),
)
"""Parameters of the change watch."""

STRONG = 4.0
"""Ratio of the statistic to its threshold from which a change is an ERROR."""


_LONGEST_SILENCE = 3.0
"""Time without a prediction after which the watch is silent, and no baseline is begun [s]."""


class ChangeReporter:
    """Follows the predictor of a model node.

    Parameters
    ----------
    node : rclpy.node.Node
        The model node.
    values : mapping
        Of the rows of `CHANGE`, by name.

    Attributes
    ----------
    watch : ChangeWatch
        The watch of the model in use.
    interval : float
        Wanted mean time between false alarms [s].
    folder : Path
        Folder of the baselines and recalibrated models.
    status : DiagnosticStatus
        The last published status.
    """

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        self._node, self.interval = node, float(values["false_alarm_interval"])
        self._duration = float(values["baseline_time"])
        given = values["baseline_folder"] or Path("~/.ros/piezo_hysteresis") / node.get_namespace().strip("/")
        self.folder = in_home(given)
        self.watch = ChangeWatch(self.interval)
        self._model: Model | None = None
        self._adopted: tuple[Model, Baseline] | None = None
        self._frame = self._problem = self._recalibration = ""
        self._alarms, self._predicted = 0, -math.inf
        self._publisher = advertise(node, "change")
        self.status = DiagnosticStatus(level=DiagnosticStatus.STALE)
        node.create_service(Trigger, "~/baseline", self._on_baseline)
        node.create_timer(1.0, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def add(self, block: SampleBlock, answer: Prediction, predictor: Predictor) -> None:
        """Follow the samples of a block that `answer` predicts."""
        if answer.model is not None and answer.model is not self._model:
            self._follow(answer.model)
        self._frame, self._predicted = block.frame, time.monotonic()
        stamp = block.stamp + round(float(block.time[-1]) * 1e9)
        try:
            completed = self.watch.add(np.ascontiguousarray(block.voltage), answer, predictor, stamp)
        except PiezoError as error:
            self._report_problem(f"the change watch has stopped: {error}")
            return
        if completed is not None:
            self._save(completed)
        if self.watch.alarms > self._alarms:
            self._alarms = self.watch.alarms
            self._publish()

    def adopt(self, model: Model, baseline: Baseline) -> None:
        """Watch a recalibrated model with the baseline of the model before, as soon as it is in use."""
        self._adopted = (model, baseline)

    def report_recalibration(self, message: str) -> None:
        """Add the result of the last recalibration to all further statuses."""
        self._recalibration = message
        self._publish()

    def _follow(self, model: Model) -> None:
        self._model, self._problem = model, ""
        if self.watch.is_taking:
            self._node.get_logger().warning("another model ended the baseline that was being taken; call ~/baseline")
        if self._adopted is not None and self._adopted[0] is model:
            self.watch, self._alarms = ChangeWatch(self.interval, self._adopted[1]), 0
            return
        path = baseline_path(self.folder, model_hash(model))
        baseline = None
        try:
            baseline = Baseline.load(path) if path.is_file() else None
        except (OSError, PiezoError) as error:
            self._report_problem(str(error))
        self.watch, self._alarms = ChangeWatch(self.interval, baseline), 0

    def _save(self, baseline: Baseline) -> None:
        path = baseline_path(self.folder, baseline.model)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            baseline.save(path)
        except OSError as error:
            self._report_problem(
                f"{path}: the baseline cannot be written ({error.strerror}); it holds until the node ends"
            )
        else:
            self._problem = ""
            self._node.get_logger().info(f"baseline of the change watch taken and kept in {path}")

    def _report_problem(self, problem: str) -> None:
        self._problem = problem
        self._node.get_logger().warning(problem, throttle_duration_sec=1.0)

    def _on_baseline(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._is_predicting
        if response.success:
            self.watch.take_baseline(self._duration)
            response.message = (
                f"taking the baseline over the next {self._duration:g} s; drive the stage as in normal use"
            )
        else:
            response.message = "no prediction: start the driver and give a model first"
        return response

    @property
    def _is_predicting(self) -> bool:
        return time.monotonic() - self._predicted < _LONGEST_SILENCE

    def _hindrance(self) -> tuple[bytes, str]:
        """Level and reason where no samples are compared with a baseline; OK and no reason where they are."""
        watch = self.watch
        if self._problem:
            return DiagnosticStatus.WARN, self._problem
        if watch.baseline is None and not watch.is_taking:
            return DiagnosticStatus.STALE, "no baseline; call ~/baseline while the stage is known to be good"
        if not self._is_predicting:
            return DiagnosticStatus.STALE, "no prediction; are driver and model there?"
        if watch.is_taking:
            return DiagnosticStatus.STALE, "taking the baseline"
        return DiagnosticStatus.STALE if watch.blind else DiagnosticStatus.OK, watch.blind

    def _publish(self) -> None:
        watch = self.watch
        change = watch.compared if watch.since else watch.change  # an alarm remains, whatever blinds the watch
        values: dict[str, object] = {"alarms": watch.alarms, "statistic": change.statistic}
        level, hindrance = self._hindrance()
        message = hindrance or "no change since the baseline"
        if watch.since:
            level = DiagnosticStatus.ERROR if change.statistic > STRONG else DiagnosticStatus.WARN
            message = f"the stage has changed: {' or '.join(change.groups)}{f'; {hindrance}' if hindrance else ''}"
        if change.groups:
            unit = UNITS[GROUPS.index(change.groups[0])]
            reach = 2.0 * change.deviation
            values |= {
                "group": ",".join(change.groups),
                "change": change.estimate,
                "change_low": change.estimate - reach,
                "change_high": change.estimate + reach,
                "unit": unit,
            }
        if self._recalibration:
            values["recalibration"] = self._recalibration
        if watch.since:
            values["onset"] = f"{watch.since // 10**9}.{watch.since % 10**9:09d}"
        name = f"{self._node.get_fully_qualified_name().lstrip('/')}: change"
        self.status = diagnostic(level, name, message, self._frame, **values)
        send(self._publisher, self.status)
