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

"""`ModelTopics`: converts predictions of a stream of samples to messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Float64

from ...acquisition.sample_block import SampleBlock
from ...channel_mapping import axes_of
from ...parameter import Parameter, Row
from ..messages.conversions import live, to_stamp
from ..messages.samples import PredictionWriter
from ..runtime.sending import is_heard, send
from ..topics import advertise

_SOURCE = "model node"
"""Source of the parameters of the topics."""

LIVE: tuple[Row, ...] = (
    Parameter("live_rate", "f_l", "Hz", 50.0, 0.1, 1000.0, "rate of the live scalars", _SOURCE),
    Parameter("rms_time", "T_r", "s", 1.0, 1e-3, 1e4, "time over which residual_rms is taken", _SOURCE),
)
"""Parameters of the live scalars."""


@dataclass(frozen=True, eq=False, slots=True)
class Predicted:
    """What is published about a block.

    Parameters
    ----------
    block : SampleBlock
        Measured samples, all of them new.
    results : mapping of str to (n,) ndarray
        ``prediction`` and ``residual`` [m], and those of further displacements, as for `PredictionWriter.write`.
    model : int
        First 32 bits of the model's hash.
    warming_up : bool
        True while voltages that were not received influence the prediction.
    residual_rms : float or None
        Of the first displacement, over `rms_time` [m].
    """

    block: SampleBlock
    results: Mapping[str, NDArray[np.float64]]
    model: int
    warming_up: bool
    residual_rms: float | None


class ModelTopics:
    """Publishers for one stream. The parameter `live_rate` is counted in samples, so that a replay publishes the same.

    Parameters
    ----------
    node : rclpy.node.Node
        A model node.
    namespace : str
        Namespace of the axis; empty for that of the node.
    """

    def __init__(self, node: Node, namespace: str = "") -> None:
        self._live_rate = float(node.get_parameter("live_rate").value)
        self._next_live = 0
        self._writer = PredictionWriter()
        self._samples, self._prediction, self._residual, self._rms, self._live = (
            advertise(node, name, namespace)
            for name in ("predicted_samples", "prediction", "residual", "residual_rms", "predicted_live")
        )

    def publish(self, predicted: Predicted, received: int, sample_period: float) -> None:
        """Publish prediction and residual of a block.

        Parameters
        ----------
        predicted : Predicted
        received : int
            Number of samples of the stream so far.
        sample_period : float
            Time between them [s].
        """
        block = predicted.block
        message = self._writer.write(block, predicted.results, predicted.model, valid=not predicted.warming_up)
        send(self._samples, message)
        step = max(1, round(1.0 / (self._live_rate * sample_period)))
        if received >= self._next_live or received < self._next_live - step:
            self._next_live = (received // step + 1) * step
            self._publish_live(predicted)

    def _publish_live(self, predicted: Predicted) -> None:
        block, newest = predicted.block, {name: float(values[-1]) for name, values in predicted.results.items()}
        for publisher, value in (
            (self._prediction, newest["prediction"]),
            (self._residual, newest["residual"]),
            (self._rms, predicted.residual_rms),
        ):
            if value is not None and is_heard(publisher):
                send(publisher, Float64(data=value))
        if not is_heard(self._live):
            return
        voltages = axes_of(block.channels, "voltage")
        values = {name: float(block.columns[name][-1]) for name in (*voltages, "displacement")} | newest
        stamp = to_stamp(block.stamp + round(float(block.time[-1]) * 1e9))
        send(self._live, live(stamp, block.frame, **values))
