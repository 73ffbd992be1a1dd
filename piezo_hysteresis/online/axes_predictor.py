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

"""`AxesPredictor`: predicts a stage of several axes block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModelError, RecordError
from ..model.axes_model import AxesModel
from .running_rms import RunningRms
from .sensor_offset import SensorOffset, samples_to_average

Array = NDArray[np.float64]

HELD = 5e-4
"""Share of the level of the identified drives within which a voltage counts as held."""


@dataclass(frozen=True, eq=False, slots=True)
class AxesPrediction:
    """Prediction and residual of one block of all axes.

    Parameters
    ----------
    prediction, residual : (n, p) ndarray
        Predicted displacements, and measured minus predicted [m].
    warming_up : bool
        True while voltages that were not received (before the first block, in a gap) influence the prediction.
    """

    prediction: Array
    residual: Array
    warming_up: bool


class AxesPredictor:
    """An `AxesModel`, its state, and the offsets of the sensors.

    Without missing samples the prediction equals ``model.run`` from rest, plus `offset`, bit for bit.

    Parameters
    ----------
    model : AxesModel
    rms_time : float
        Time over which `residual_rms` is computed [s].

    Attributes
    ----------
    model : AxesModel
    warming_up : bool
        True until every unknown voltage is forgotten: by the responses after `AxesModel.settling` samples, by the play
        operators when the elongation of every actuator has covered the widest of them.

    Examples
    --------
    >>> model = AxesModel(np.full((1, 1, 1, 3), 1e-6), np.eye(1), np.empty(0), np.zeros(1), 1e-3, 1.0, 0.05)
    >>> answer = AxesPredictor(model).predict([[0.0], [0.0]], [[2e-9], [2e-9]], restarted=True)
    >>> answer.prediction.tolist(), answer.residual.tolist()
    ([[2e-09], [2e-09]], [[0.0], [0.0]])
    """

    def __init__(self, model: AxesModel, rms_time: float = 1.0) -> None:
        self.model = model
        self._rms = [RunningRms.over(rms_time, model.sample_period) for _ in range(model.outputs)]
        self._state, self._last = model.rest(), np.zeros(model.inputs)
        self._count = 0
        self.warming_up = False
        self.zero()

    @property
    def offset(self) -> Array:
        """Sensors minus model, shape (p,) [m]: the mean over the window in which it was measured."""
        return np.array([zero.offset for zero in self._zeros])

    @property
    def residual_rms(self) -> tuple[float | None, ...]:
        """Rms of every residual over the last `rms_time` [m]; None before there is one."""
        return tuple(rms.value for rms in self._rms)

    @property
    def level(self) -> float:
        """Running rms of the drives after the newest sample [V]."""
        return float(np.sqrt(self._state.power[0]))

    def zero(self) -> None:
        """Measure the offsets again, over the next 0.1 s and at least 20 samples."""
        wanted = samples_to_average(self.model.sample_period)
        self._zeros = [SensorOffset(self._count, wanted) for _ in range(self.model.outputs)]
        for rms in self._rms:
            rms.clear()

    def predict(
        self,
        voltages: ArrayLike,
        displacements: ArrayLike,
        missing: int = 0,
        *,
        restarted: bool = False,
        settled: bool = True,
        follows_gap: bool = False,
    ) -> AxesPrediction:
        """Predict the next block and compare it with the measurement.

        Parameters
        ----------
        voltages : (n, m) array_like
            Drive voltages [V].
        displacements : (n, p) array_like
            Measured displacements [m].
        missing : int
            Number of samples before it that were not received.
        restarted : bool
            True for the first block of a stream: the stage has rested at its first voltages, if it is `settled`.
        settled : bool
            False if the stage had been driven before the first block.
        follows_gap : bool
            True if the missing samples were never measured: the drives were held meanwhile.

        Raises
        ------
        RecordError
            If the block has other numbers of drives or displacements than the model, or not as many of one as of the
            other, or if a displacement is not finite.
        ModelError
            If a voltage is not finite.
        """
        u, measured = np.asarray(voltages, dtype=np.float64), np.asarray(displacements, dtype=np.float64)
        if u.ndim != 2 or measured.shape != (len(u), self.model.outputs) or u.shape[1] != self.model.inputs:
            self._forget()
            raise RecordError(
                f"samples: got {u.shape[-1]} drives and {measured.shape[-1]} displacements, expected "
                f"{self.model.inputs} and {self.model.outputs} as the model has"
            )
        if not np.isfinite(measured).all():
            self._forget()
            raise RecordError("displacements: got samples that are not finite, expected numbers; leave them out")
        if restarted:
            self._begin(u, settled)
        elif missing:
            self._hold(missing)
            if not follows_gap:
                self._forget()
        was_warming_up = self.warming_up
        try:
            modelled, self._state = self.model.run(u, self._state)
        except ModelError:
            self._forget()
            raise
        self._last = u[-1].copy()
        if was_warming_up:
            self._remember(modelled)
        for zero, y, x in zip(self._zeros, measured.T, modelled.T, strict=True):
            zero.add(y, x, 0.0)
        self._count += len(u)
        prediction = modelled + self.offset
        residual = measured - prediction
        for rms, error in zip(self._rms, residual.T, strict=True):
            rms.add(np.ascontiguousarray(error))
        if was_warming_up and not self.warming_up:
            self.zero()
        return AxesPrediction(prediction, residual, was_warming_up)

    def _begin(self, u: Array, settled: bool) -> None:
        """Start from rest at the first voltages, and forget it slowly if the stage did not rest there."""
        self._state, self._last, self.warming_up = self.model.rest(), u[0].copy(), False
        if u[0].any():
            self._hold(self.model.settling)
        is_held = len(u) > 1 and np.ptp(u, axis=0).max() <= HELD * self.model.reference
        if not (settled and is_held):
            self._forget()
        self.zero()

    def _hold(self, count: int) -> None:
        """Hold the last voltages for some samples, after which the model is settled."""
        count = min(count, self.model.settling)
        _, self._state = self.model.run(np.tile(self._last, (count, 1)), self._state)

    def _forget(self) -> None:
        self.warming_up, self._left = True, self.model.settling
        self._lowest, self._highest = np.full(self.model.inputs, np.inf), np.full(self.model.inputs, -np.inf)

    def _remember(self, modelled: Array) -> None:
        """Follow how much of the unknown state is left."""
        self._left -= len(modelled)
        elongations = modelled @ self.model.elongation.T
        self._lowest = np.minimum(self._lowest, elongations.min(axis=0))
        self._highest = np.maximum(self._highest, elongations.max(axis=0))
        covered = float((self._highest - self._lowest).min())
        self.warming_up = self._left > 0 or covered < 2.0 * float(self.model.radii.max(initial=0.0))
