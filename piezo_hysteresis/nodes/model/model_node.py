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

"""`model_node`: runs a model with a stage, and publishes prediction and residual of every sample."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from std_msgs.msg import String
from std_srvs.srv import Trigger

from ...acquisition.sample_block import SampleBlock
from ...errors import PiezoError
from ...model.model import Model
from ...model.model_file import load, loads
from ...model.model_parameters import hash_number, model_hash
from ...online.prediction import Prediction
from ...online.predictor import Predictor
from ...online.warmup import compile_kernels
from ...parameter import Row, Setting
from ...recording.table.time_column import round_period
from ..messages.samples import SampleReader
from ..runtime.guarded_node import GuardedNode
from ..runtime.launch_values import LISTENING
from ..runtime.node_clock import now
from ..runtime.parameters import declare, let_change, read
from ..runtime.process import run
from ..topics import subscribe
from .change_reporter import CHANGE, ChangeReporter
from .diagnostics import ModelDiagnostics
from .publishers import LIVE, ModelTopics, Predicted
from .recalibrator import Recalibrator
from .residual_alarm import ALARM, ResidualAlarm
from .stream_period import TOLERANCE, StreamPeriod

MODEL: tuple[Row, ...] = (
    Setting("model_file", "", "path of the first model; a model on the topic `model` replaces it"),
    *LIVE,
    *ALARM,
    *CHANGE,
)
"""Parameters of the model node."""


class ModelNode(GuardedNode):
    """Predictor of one axis: topics, services and parameters stand in docs/ros."""

    def __init__(self) -> None:
        super().__init__("model_node")
        self.hold_name()
        declare(self, MODEL)
        self._values = read(self, MODEL)
        compile_kernels(self.get_logger().info)
        self._model: Model | None = None
        self._predictor: Predictor | None = None
        self._period = StreamPeriod()
        self._reader = SampleReader()
        self._topics = ModelTopics(self)
        self._numbered: tuple[Model, int] | None = None
        self._changes = ChangeReporter(self, self._values)
        self._diagnostics = ModelDiagnostics(self, ResidualAlarm(self._values), self._changes)
        self._recalibrator = Recalibrator(self, self._changes, self._follow)
        if self._values["model_file"]:
            try:
                self._follow(self._usable(self._values["model_file"]))
            except PiezoError as error:
                self._diagnostics.refused(f"model_file: {error}")
        let_change(self, MODEL, "model_file", self._usable, self._switch)
        subscribe(self, "model", self._on_model)
        subscribe(self, "samples", self._on_samples, deep=True, raw=True)
        self.create_service(Trigger, "~/zero", self._on_zero)
        self.get_logger().info(LISTENING)

    def _on_samples(self, message: bytes) -> None:
        try:
            block = self._reader.read(message)
            predictor = self._predictor_for(block)
            if predictor is None:
                return
            answer = predictor.predict(
                int(block.index[0]),
                block.stamp + round(float(block.time[0]) * 1e9),
                block.voltage,
                block.displacement,
                follows_gap=block.follows_gap,
                settled=block.index[0] == 0 or block.phase[0] == 0,  # not driven since the driver began
            )
        except PiezoError as error:
            self._diagnostics.problem(str(error))
            return
        if answer.refused is not None:
            self._diagnostics.refused(str(answer.refused))
        self._use(predictor.model)
        self._diagnostics.saw(block, now(self))
        if answer.model is not None and answer.prediction.size:
            counted = block.after(answer.first)
            self._publish(counted, answer, answer.model, predictor)
            self._changes.add(counted, answer, predictor)
            self._recalibrator.add(counted, answer, predictor)

    def _publish(self, block: SampleBlock, answer: Prediction, model: Model, predictor: Predictor) -> None:
        if self._numbered is None or self._numbered[0] is not model:
            self._numbered = (model, hash_number(model))
        results = {"prediction": answer.prediction, "residual": answer.residual}
        predicted = Predicted(block, results, self._numbered[1], answer.warming_up, predictor.residual_rms)
        self._topics.publish(predicted, predictor.sequence.received, predictor.sample_period)

    def _predictor_for(self, block: SampleBlock) -> Predictor | None:
        """The predictor of the stream. Another sample period gives a new one; None while it is unknown."""
        period, present = self._period.of(block), self._predictor
        if period is None:
            return present
        if present is None or abs(period / present.sample_period - 1.0) > TOLERANCE:
            model = self._model if present is None else present.newest_model or self._model
            self._predictor = Predictor(round_period(period, 1e-6), rms_time=self._values["rms_time"])
            self._diagnostics.follow(self._predictor)
            if model is not None:
                self._predictor.swap(model)
        return self._predictor

    def _on_model(self, message: String) -> None:
        try:
            model = loads(message.data, "topic 'model'")
            if not self._is_followed(model):
                self._follow(model)
        except PiezoError as error:
            self._diagnostics.refused(str(error))

    def _is_followed(self, model: Model) -> bool:
        """True where this model is in use or about to be, for example after a recalibration by this node."""
        newest = None if self._predictor is None else self._predictor.newest_model
        return newest is not None and model_hash(model) == model_hash(newest)

    def end(self) -> None:
        """End a running fit."""
        self._recalibrator.end()

    def _usable(self, path: str) -> Model:
        """The model in a file; raises PiezoError if there is none, or if it is too slow for the stream."""
        model = load(path)
        if self._predictor is not None:
            model.at(self._predictor.sample_period)
        return model

    def _switch(self, model: Model) -> None:
        """Follow the model of a file; if it diverges on the voltages so far, the present one stays."""
        try:
            self._follow(model)
        except PiezoError as error:
            self._diagnostics.refused(f"model_file: {error}")

    def _follow(self, model: Model, offset: float | None = None) -> None:
        if self._predictor is None:
            self._use(model)
        else:
            self._predictor.swap(model, offset)
            self._use(self._predictor.model)

    def _use(self, model: Model | None) -> None:
        """Report a model that is in use from now on. One that cannot predict is kept for a stream of another period."""
        if model is not None and model is not self._model:
            self._model = model
            self._diagnostics.model(model)

    def _on_zero(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._predictor is not None
        if self._predictor is None:
            response.message = "no samples have arrived yet, so that the offset cannot be taken"
        else:
            self._predictor.zero()
            response.message = "the offset is the mean residual of the next 0.1 s, and of at least 20 samples"
        return response


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a model node; its exit code is 2 where its parameters are invalid."""
    return run(ModelNode, arguments, end=ModelNode.end)


if __name__ == "__main__":
    sys.exit(main())
