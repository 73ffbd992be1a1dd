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

"""`Recalibrator`: `~/recalibrate` of a model node: fits the changed group to the last minute and changes the model."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ...acquisition.sample_block import SampleBlock
from ...changes.minute import Minute
from ...changes.moved_group import group_to_fit
from ...changes.recalibration_history import Recalibrations, write_numbers
from ...errors import IdentificationError, PiezoError, RecordingError, reason_of
from ...model.model import Model
from ...model.model_file import dumps, loads, save
from ...model.model_parameters import model_hash
from ...online.change.baseline import Baseline
from ...online.change.watch import baseline_path
from ...online.prediction import Prediction
from ...online.predictor import Predictor
from ...online.recent_displacement import RecentDisplacement
from ..runtime.fit_process import FitProcess
from ..runtime.sending import send
from ..topics import advertise
from .change_reporter import ChangeReporter
from .recalibration_job import RecalibrationOutcome, recalibration, write_task

_TICK = 0.1
"""Time between two checks of the fit [s]."""

_SHOWN = 100
"""Newest lines of the history that are published."""

Swap = Callable[[Model, float | None], None]
"""Function that takes the new model and its offset [m]; None where the offset has to be measured again."""


class Recalibrator:
    """Keeps the last minute of displacement and the history of the recalibrations.

    Parameters
    ----------
    node : rclpy.node.Node
        The model node.
    changes : ChangeReporter
        Its change watch.
    swap : callable
        Function that changes the model.
    """

    def __init__(self, node: Node, changes: ChangeReporter, swap: Swap) -> None:
        self._node, self._changes, self._swap = node, changes, swap
        self._recent: RecentDisplacement | None = None
        self._predictor: Predictor | None = None
        self._fit: _Fit | None = None
        self._fitted: _Fitted | None = None
        self._history: Recalibrations | None = None
        self._table = advertise(node, "recalibrations")
        self._models = advertise(node, "recalibrated_model")
        try:
            self._history = Recalibrations(changes.folder)
        except RecordingError as error:
            node.get_logger().warning(f"no history of recalibrations: {error}")
        self._publish()
        node.create_service(Trigger, "~/plan_recalibration", self._on_plan)
        node.create_service(Trigger, "~/recalibrate", self._on_recalibrate)
        node.create_timer(_TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """End a running recalibration without its result."""
        fit, self._fit, self._fitted = self._fit, None, None
        if fit is not None:
            fit.close()

    def add(self, block: SampleBlock, answer: Prediction, predictor: Predictor) -> None:
        """Keep the displacement of a block that `answer` predicts, while there is a baseline."""
        if predictor is not self._predictor or self._recent is None:
            self._predictor, self._recent = predictor, RecentDisplacement(predictor.sample_period)
        if answer.warming_up or self._changes.watch.baseline is None:
            self._recent.clear()
        else:
            self._recent.add(int(block.index[0]), np.asarray(block.displacement))

    def _group(self) -> str:
        """The group to fit; raises IdentificationError with the reason where a recalibration is impossible."""
        watch = self._changes.watch
        if self._fit is not None or self._fitted is not None:
            raise IdentificationError("a recalibration is under way; wait")
        if watch.baseline is None:
            raise IdentificationError("no baseline; call ~/baseline while the stage is known to be good")
        if not watch.since:
            raise IdentificationError("no change since the baseline; nothing to recalibrate")
        return group_to_fit(watch.groups)

    def _on_plan(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            group = self._group()
        except PiezoError as error:
            response.message = str(error)
            return response
        response.success = True
        response.message = (
            f"{group} has changed: fits it, and the zero of the sensor, to the last minute of samples, and replaces "
            "the model if the residual is back at that of the baseline. The stage does not move."
        )
        return response

    def _on_recalibrate(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            group = self._group()
        except PiezoError as error:
            response.message = str(error)
            return response
        watch, predictor, recent = self._changes.watch, self._predictor, self._recent
        model = None if predictor is None else predictor.model
        baseline = watch.baseline
        if predictor is None or recent is None or model is None or baseline is None:
            response.message = "no prediction yet: start the driver and give a model first"
            return response
        minute = Minute(predictor.drive, recent.copy(), predictor.offset)
        statistic = watch.change.statistic

        def write(folder: Path) -> None:
            write_task(folder, minute, baseline, group, self._changes.interval, statistic)

        self._fit = _Fit(write, model, predictor, predictor.offset)
        self._changes.report_recalibration(f"fitting {group}")
        response.success = True
        response.message = f"fitting {group} to the last {minute.displacement.size * predictor.sample_period:.0f} s"
        return response

    def _tick(self) -> None:
        try:
            fit = self._fit
            outcome = None if fit is None else fit.poll()
            if fit is not None and outcome is not None:
                self.end()
                self._begin_swap(fit, outcome)
            if self._fitted is not None:
                self._finish(self._fitted)
        except Exception as error:
            self.end()
            self._changes.report_recalibration(f"refused: {reason_of(error)}")
            if not isinstance(error, PiezoError):
                raise  # the node counts and shows it as a fault
            self._node.get_logger().warning(f"recalibration: {error}")

    def _begin_swap(self, fit: _Fit, outcome: RecalibrationOutcome) -> None:
        if self._predictor is not fit.predictor or fit.predictor.newest_model is not fit.model:
            raise IdentificationError("another model or another stream is in use by now; nothing was changed")
        model, baseline = loads(outcome.model), self._changes.watch.baseline
        if baseline is None:
            raise IdentificationError("the baseline was removed meanwhile; nothing was changed")
        fitted = _Fitted(fit.model, model, baseline.of_model(model_hash(model)), outcome)
        self._swap(model, outcome.offset if fit.predictor.offset == fit.offset else None)
        self._changes.adopt(model, fitted.baseline)
        self._fitted = fitted

    def _finish(self, fitted: _Fitted) -> None:
        """Keep and publish the new model as soon as it is in use."""
        predictor, model, outcome = self._predictor, fitted.model, fitted.outcome
        newest = None if predictor is None else predictor.newest_model
        if newest is fitted.before:
            raise IdentificationError("the new model diverges on the drive voltages so far; nothing was changed")
        if predictor is None or newest is not model:
            raise IdentificationError("another model is in use by now; the new one was not kept")
        if predictor.model is not model:
            return
        self._fitted = None
        is_new = model_hash(model) != model_hash(fitted.before)
        folder, problem = self._changes.folder, ""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            fitted.baseline.save(baseline_path(folder, fitted.baseline.model))
            if is_new:
                save(model, folder / f"recalibrated_{model_hash(model).partition(':')[2]}.yaml")
            if self._history is not None:
                self._history.add(outcome.numbers)
        except (OSError, PiezoError) as error:
            problem = f"; not kept: {error}"
        if is_new:
            send(self._models, String(data=dumps(model)))
        self._publish()
        for line in (outcome.verdict, *outcome.summary.splitlines()):
            self._node.get_logger().info(line)
        self._changes.report_recalibration(f"{outcome.verdict}; {'; '.join(outcome.summary.splitlines())}{problem}")

    def _publish(self) -> None:
        if self._history is not None:
            send(self._table, String(data=write_numbers(self._history.numbers[-_SHOWN:])))


@dataclass(frozen=True, slots=True)
class _Fitted:
    """A recalibrated model on its way into use, with the model before it and its baseline."""

    before: Model
    model: Model
    baseline: Baseline
    outcome: RecalibrationOutcome


class _Fit:
    """A fit in another process. A thread writes its data, so that the stream does not wait."""

    def __init__(self, write: Callable[[Path], None], model: Model, predictor: Predictor, offset: float) -> None:
        self.model, self.predictor, self.offset = model, predictor, offset
        self._folder = tempfile.TemporaryDirectory(prefix="piezo_recalibration_", ignore_cleanup_errors=True)
        self._process: FitProcess[RecalibrationOutcome] | None = None
        self._failure: Exception | None = None

        def prepare() -> None:
            try:
                write(Path(self._folder.name))
            except Exception as error:  # it is raised again where it is reported
                self._failure = error

        self._thread = threading.Thread(target=prepare, name="recalibration", daemon=True)
        self._thread.start()

    def poll(self) -> RecalibrationOutcome | None:
        """The outcome, or None while the fit is running; raises the reason where it failed."""
        if self._thread.is_alive():
            return None
        if isinstance(self._failure, OSError) and self._failure.strerror:
            raise IdentificationError(f"the samples cannot be written ({self._failure.strerror}); is the disk full?")
        if self._failure is not None:
            raise self._failure
        if self._process is None:
            self._process = FitProcess(recalibration, Path(self._folder.name), dumps(self.model))
        return self._process.poll()

    def close(self) -> None:
        """End the fit, finished or not."""
        self._thread.join()
        if self._process is not None:
            self._process.close()
        self._folder.cleanup()
