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

"""`axes_model_node`: runs a model of several axes with a stage, and publishes predictions and residuals."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial

import numpy as np
from rclpy.exceptions import InvalidTopicNameException
from rclpy.impl.implementation_singleton import rclpy_implementation
from std_srvs.srv import Trigger

from ...blocks.kernel import on_compilation
from ...errors import PiezoError, RecordError, printable
from ...model import axes_file
from ...model.axes_model import AxesModel
from ...model.model_parameters import first_bits
from ...online.axes_joiner import AxesJoiner, JoinedBlock, require_period
from ...online.axes_predictor import AxesPredictor
from ...parameter import Row, Setting, parts_of
from ..model.publishers import LIVE, Predicted
from ..model.residual_alarm import ALARM
from ..runtime.guarded_node import GuardedNode
from ..runtime.launch_values import LISTENING
from ..runtime.node_clock import now
from ..runtime.parameters import declare, let_change, read
from ..runtime.process import run
from .axes_diagnostics import AxesDiagnostics
from .axis_stream import AxisStream, columns, results_of, slices

AXES: tuple[Row, ...] = (
    Setting("model_file", "", "path of a model of several axes, an NPZ file of piezo identify"),
    Setting(
        "axes",
        "",
        "namespaces of the drivers in the order of the model, separated by commas; empty: that of the node, whose "
        "`samples` hold all axes (voltage_2, displacement_2, ...)",
    ),
    *LIVE,
    *ALARM,
)
"""Parameters of the model node of several axes."""


class AxesModelNode(GuardedNode):
    """Predictor of several axes: topics, services and parameters stand in docs/several_axes and docs/ros."""

    def __init__(self) -> None:
        super().__init__("axes_model_node")
        self.hold_name()
        declare(self, AXES)
        self._values = read(self, AXES)
        self._streams = [
            AxisStream(self, name, partial(self._on_samples, number))
            for number, name in enumerate(self._namespaces(self._values["axes"]))
        ]
        self._diagnostics = AxesDiagnostics(self, [stream.name for stream in self._streams], self._values)
        self._joiner: AxesJoiner | None = None
        self._predictor: AxesPredictor | None = None
        if self._values["model_file"]:
            try:
                self._follow(self._usable(self._values["model_file"]))
            except PiezoError as error:
                self._diagnostics.refused(f"model_file: {error}")
        let_change(self, AXES, "model_file", self._usable, self._follow)
        self.create_service(Trigger, "~/zero", self._on_zero)
        self.get_logger().info(f"{LISTENING} of {', '.join(stream.name for stream in self._streams)}")

    def _namespaces(self, given: str) -> list[str]:
        """Namespaces in the parameter `axes`; RecordError if one is invalid, or given twice."""
        names = parts_of(given)
        try:
            topics = {self.resolve_topic_name(f"{name.rstrip('/')}/samples") for name in names}
        except (ValueError, InvalidTopicNameException, rclpy_implementation.RCLError):
            topics = set()
        if len(topics) != len(names):
            raise RecordError(
                f"axes: got '{printable(given)}', expected namespaces such as /stage_x,/stage_y, each of them once"
            )
        return names or [""]

    def _on_samples(self, number: int, message: bytes) -> None:
        stream = self._streams[number]
        try:
            block = stream.read(message)
            self._diagnostics.saw(number, block, now(self))
            if self._joiner is None or self._predictor is None:
                return
            self._require_axes(self._predictor.model)
            self._joiner.add(number, block)
            for joined in self._joiner.take():
                self._predict(joined, self._joiner, self._predictor)
        except PiezoError as error:
            self._diagnostics.problem(f"{stream.name}: {error}")

    def _require_axes(self, model: AxesModel) -> None:
        """Refuse blocks with other axes than those of the model, as soon as a block of every stream is known."""
        known = [stream.axes for stream in self._streams if stream.axes is not None]
        drives, displacements = (sum(axes[quantity] for axes in known) for quantity in range(2))
        if len(known) == len(self._streams) and (drives, displacements) != (model.inputs, model.outputs):
            raise RecordError(
                f"got {drives} drives and {displacements} displacements of all axes, expected {model.inputs} and "
                f"{model.outputs} as the model has"
            )

    def _predict(self, joined: JoinedBlock, joiner: AxesJoiner, predictor: AxesPredictor) -> None:
        answer = predictor.predict(
            columns(joined.blocks, "voltage"),
            columns(joined.blocks, "displacement"),
            joined.missing,
            restarted=joined.restarted,
            settled=joined.is_undriven,
            follows_gap=joined.follows_gap,
        )
        for stream, block, axes in zip(self._streams, joined.blocks, slices(joined.blocks), strict=True):
            results = results_of(block, answer.prediction[:, axes], answer.residual[:, axes])
            rms = predictor.residual_rms[axes.start]
            predicted = Predicted(block, results, self._number, answer.warming_up, rms)
            stream.topics.publish(predicted, joiner.joined, joiner.sample_period)
        self._diagnostics.reached(predictor.level)

    def _usable(self, path: str) -> AxesModel:
        """The model in a file; raises PiezoError if there is none, or if the streams have other samples than it."""
        model = axes_file.load(path)
        self._require_axes(model)
        for stream in self._streams:
            if stream.period is not None:
                require_period(stream.period, model.sample_period)
        return model

    def _follow(self, model: AxesModel) -> None:
        self._compile(model)
        self._number = first_bits(axes_file.content_hash(model))
        self._joiner = AxesJoiner(len(self._streams), model.sample_period)
        self._predictor = AxesPredictor(model, self._values["rms_time"])
        self._diagnostics.follow(self._joiner, self._predictor)

    def _compile(self, model: AxesModel) -> None:
        """Run the kernel once, so that it is compiled before the first block."""
        with on_compilation(lambda: self.get_logger().info("compiling the kernel, once")):
            model.run(np.zeros((1, model.inputs)), model.rest())

    def _on_zero(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._predictor is not None
        response.message = "there is no model; set model_file"
        if self._predictor is not None:
            self._predictor.zero()
            response.message = "the offsets are the mean residuals of the next 0.1 s, and of at least 20 samples"
        return response


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a model node of several axes; its exit code is 2 where its parameters are invalid."""
    return run(AxesModelNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
