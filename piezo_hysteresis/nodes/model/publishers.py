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

"""`ModelTopics`: converts predictions of the model node to messages."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import Float64

from ...acquisition.sample_block import SampleBlock
from ...model.model import Model
from ...model.model_parameters import hash_number
from ...online.prediction import Prediction
from ...online.predictor import Predictor
from ..messages.conversions import live, to_stamp
from ..messages.samples import PredictionWriter
from ..runtime.sending import is_heard, send
from ..topics import advertise


class ModelTopics:
    """Publishers of a model node. The parameter `live_rate` is counted in samples, so that a replay publishes the same.

    Parameters
    ----------
    node : rclpy.node.Node
        The model node.
    """

    def __init__(self, node: Node) -> None:
        self._live_rate = float(node.get_parameter("live_rate").value)
        self._next_live = 0
        self._named: tuple[Model, int] | None = None
        self._writer = PredictionWriter()
        self._samples = advertise(node, "predicted_samples")
        self._prediction = advertise(node, "prediction")
        self._residual = advertise(node, "residual")
        self._rms = advertise(node, "residual_rms")
        self._live = advertise(node, "predicted_live")

    def publish(self, block: SampleBlock, answer: Prediction, model: Model, predictor: Predictor) -> None:
        """Publish prediction and residual of a block, all of whose samples are new; `model` computed them."""
        if self._named is None or self._named[0] is not model:
            self._named = (model, hash_number(model))
        message = self._writer.write(
            block, answer.prediction, answer.residual, self._named[1], valid=not answer.warming_up
        )
        send(self._samples, message)
        step = max(1, round(1.0 / (self._live_rate * predictor.sample_period)))
        received = predictor.sequence.received
        if received >= self._next_live or received < self._next_live - step:
            self._next_live = (received // step + 1) * step
            self._publish_live(block, answer, predictor.residual_rms)

    def _publish_live(self, block: SampleBlock, answer: Prediction, rms: float | None) -> None:
        prediction, residual = float(answer.prediction[-1]), float(answer.residual[-1])
        for publisher, value in ((self._prediction, prediction), (self._residual, residual), (self._rms, rms)):
            if value is not None and is_heard(publisher):
                send(publisher, Float64(data=value))
        if not is_heard(self._live):
            return
        values = {
            "voltage": float(block.voltage[-1]),
            "displacement": float(block.displacement[-1]),
            "prediction": prediction,
            "residual": residual,
        }
        stamp = to_stamp(block.stamp + round(float(block.time[-1]) * 1e9))
        send(self._live, live(stamp, block.frame, **values))
