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

"""`AxisStream`: the samples of one namespace, their channels, and the topics of their predictions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from ...acquisition.sample_block import SampleBlock
from ...channel_mapping import axes_of, axis_of
from ..messages.samples import SampleReader
from ..model.publishers import ModelTopics
from ..topics import subscribe

Array = NDArray[np.float64]


class AxisStream:
    """Subscription and publishers of one namespace.

    Parameters
    ----------
    node : rclpy.node.Node
        The model node.
    namespace : str
        Namespace of a driver; empty for that of the node.
    received : callable
        Called with every serialised message of `samples`.

    Attributes
    ----------
    name : str
        The namespace.
    axes : tuple of int, or None
        Numbers of voltages and of displacements in the newest block; None before the first one.
    period : float or None
        Sample period of the newest block of several samples [s]; None before the first one.
    topics : ModelTopics
        Publishers of the predictions.
    """

    def __init__(self, node: Node, namespace: str, received: Callable[[bytes], None]) -> None:
        self.name = namespace or node.get_namespace()
        self.axes: tuple[int, int] | None = None
        self.period: float | None = None
        self._reader = SampleReader(axis_of)
        self.topics = ModelTopics(node, namespace)
        subscribe(node, "samples", received, namespace, deep=True, raw=True)

    def read(self, message: bytes) -> SampleBlock:
        """Block of a message with its further axes; RecordError where it cannot be read."""
        block = self._reader.read(message)
        self.axes = len(axes_of(block.channels, "voltage")), len(axes_of(block.channels, "displacement"))
        self.period = block.sample_period or self.period
        return block


def results_of(block: SampleBlock, prediction: Array, residual: Array) -> dict[str, Array]:
    """Prediction and residual (n, p) of the displacements of a block, by the names of `PredictionWriter.write`."""
    results: dict[str, Array] = {}
    for name, y, e in zip(axes_of(block.channels, "displacement"), prediction.T, residual.T, strict=True):
        number = name.removeprefix("displacement")
        results |= {f"prediction{number}": y, f"residual{number}": e}
        if number:
            results[name] = block.channels[name]
    return results


def columns(blocks: tuple[SampleBlock, ...], quantity: str) -> Array:
    """Samples of one quantity of all streams, in the order of the streams and of their numbers, shape (n, axes)."""
    return np.column_stack([b.columns[name] for b in blocks for name in axes_of(b.channels, quantity)])


def slices(blocks: tuple[SampleBlock, ...]) -> Iterator[slice]:
    """The displacements of every stream among those of all."""
    first = 0
    for block in blocks:
        count = len(axes_of(block.channels, "displacement"))
        yield slice(first, first + count)
        first += count
