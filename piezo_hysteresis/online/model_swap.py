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

"""`ModelSwap`: runs a new model over the voltage history until it can replace the present model."""

from __future__ import annotations

import math

from ..errors import ParameterError
from ..model.model import Model
from .sensor_offset import SensorOffset
from .voltage_history import VoltageHistory
from .warmup import Warmup

PIECE = 50_000
"""Fewest samples of the history that a new model processes per block of the stream; it takes a few milliseconds."""

PACE = 8
"""Fewest samples of the history that a new model processes per sample of the stream, so that it reaches the end."""


class ModelSwap:
    """One model that is being run over the history, and the newest of the models that were requested meanwhile."""

    def __init__(self) -> None:
        self._running: Warmup | None = None
        self._waiting: tuple[Model, float | None] | None = None

    @property
    def is_running(self) -> bool:
        """Whether a model is being run over the history."""
        return self._running is not None

    @property
    def newest(self) -> Model | None:
        """The model that will be used at the end; None if there is no new model."""
        if self._waiting is not None:
            return self._waiting[0]
        return None if self._running is None else self._running.model

    def request(self, model: Model, offset: float | None) -> None:
        """Run a model over the history after the one that is running; it replaces a model that waits.

        Parameters
        ----------
        model : Model
            Model to change to.
        offset : float or None
            Its sensor offset [m]; None if it is unknown.

        Raises
        ------
        ParameterError
            If the offset is not finite.
        """
        if offset is not None and not math.isfinite(offset):
            raise ParameterError(f"offset: got {offset:g} m, expected a finite number")
        self._waiting = model, offset

    def advance(self, received: int, history: VoltageHistory, zero: SensorOffset) -> Warmup | None:
        """Run the new model over the next piece of the history.

        Parameters
        ----------
        received : int
            Samples of the stream that came with the newest block.
        history : VoltageHistory
            Voltages of the stream.
        zero : SensorOffset
            Present offset of the stream; a model whose run begins now averages its prediction over the same window.

        Returns
        -------
        Warmup or None
            The run, if it has reached the end of the history.

        Raises
        ------
        ModelError
            If the stream is faster than the model; it is dropped.
        DivergenceError
            If the model diverges; it is dropped.
        """
        if self._running is None and self._waiting is not None:
            (model, offset), self._waiting = self._waiting, None
            self._running = Warmup(model, history, zero, offset)
        warmup, self._running = self._running, None
        if warmup is None or warmup.advance(max(PIECE, PACE * received)):
            return warmup
        self._running = warmup
        return None
