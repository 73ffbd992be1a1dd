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

"""`Predictor`: predicts a stage block by block, and changes to a new model while samples arrive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DivergenceError, PiezoError, RecordError
from ..model.chain import Chain, ChainState
from ..model.free_run import after_hold
from ..model.model import Model
from ..model.samples import samples
from .model_swap import ModelSwap
from .prediction import Prediction
from .running_rms import RunningRms
from .sensor_offset import SensorOffset, samples_to_average
from .sequence_check import LONGEST_SILENCE, SequenceCheck
from .voltage_history import FULL_SAMPLES, REST_TOLERANCE, DriveHistory, VoltageHistory, is_held

Array = NDArray[np.float64]

FORGETTING = 2.0
"""Travel of the drive [voltage scales] after which the initial state of a hysteresis loop counts as forgotten."""


class Predictor:
    """Model, carried state and voltage history of one stream of samples.

    Parameters
    ----------
    sample_period : float
        Time between samples of the stream [s].
    model : Model, optional
        First model. Without a model the predictor only keeps the history.
    rms_time : float
        Time over which `residual_rms` is computed [s].

    Attributes
    ----------
    model, chain, state : Model, Chain, ChainState or None
        Present model, its coefficients, and its state after the newest sample.
    sequence : SequenceCheck
        Counts of received, lost and repeated samples.

    Notes
    -----
    Without lost samples the prediction equals ``model.run`` from rest at the first voltage, plus `offset`, bit for bit.
    Effects that depend on time count it from the first sample. A new model replaces the old one between two blocks,
    after it has been run over the history. The stage counts as at rest while the drive stays within 5 mV of one level
    (without a model), or within 1/2000 of the voltage scale of the model.

    Raises
    ------
    RecordError, ParameterError, ModelError
        If the sample period is outside the limits, `rms_time` is not positive, or the stream is faster than the model.

    Examples
    --------
    >>> from piezo_hysteresis.effects import Arx, BoucWen
    >>> predictor = Predictor(2e-5, Model((BoucWen(), Arx(b=[0.5])), 2e-5))
    >>> predictor.predict(0, 0, [0.0, 0.0], [3e-6, 3e-6]).residual.tolist(), predictor.offset
    ([0.0, 0.0], 3e-06)
    """

    def __init__(self, sample_period: float, model: Model | None = None, rms_time: float = 1.0) -> None:
        self.sequence, self.sample_period, self.model = SequenceCheck(sample_period), sample_period, model
        self.chain: Chain | None = None
        self._swap, self._joined_moving = ModelSwap(), False
        self._rms = RunningRms.over(rms_time, sample_period)
        self._begin()

    @property
    def offset(self) -> float:
        """Sensor minus model [m]: the mean over the window in which it was measured, or the value given to `swap`."""
        return self._zero.offset

    @property
    def is_swapping(self) -> bool:
        """True while a new model is being run over the history."""
        return self._swap.newest is not None

    @property
    def newest_model(self) -> Model | None:
        """The model that will be in use when it has been run over the history; the present one if there is no other."""
        return self._swap.newest or self.model

    @property
    def warming_up(self) -> bool:
        """True while voltages that were not received (before the first block, in a gap) influence the prediction."""
        forgotten = np.inf if self.model is None else FORGETTING * self.model.voltage_scale
        return self._history.known_travel < forgotten

    @property
    def residual_rms(self) -> float | None:
        """Rms of the residual over the last `rms_time` [m]; None before there is one."""
        return self._rms.value

    @property
    def drive(self) -> DriveHistory:
        """The drive voltage so far, as far as the history keeps it."""
        return self._history.copy()

    def swap(self, model: Model, offset: float | None = None) -> None:
        """Change to another model after it has been run over the history; `offset` [m] is its sensor offset, if known.

        If models arrive faster than they can be run over the history, only the newest of them waits.

        Raises
        ------
        ModelError, ParameterError
            If the stream is faster than the model, or the offset is not finite; the present model stays.
        DivergenceError
            If the model diverges on the first part of the history; of a later part, `predict` returns the reason.
        """
        chain = model.at(self.sample_period)
        if self._history.count == 0:
            self.chain, self.model, self._history.tolerance = chain, model, REST_TOLERANCE * model.voltage_scale
            return
        self._swap.request(model, offset)
        if not self._swap.is_running:
            self._advance_swap(0)

    def zero(self) -> None:
        """Measure the offset again, over the next 0.1 s and at least 20 samples."""
        self._zero_from(self._history.count)

    def predict(
        self,
        index: int,
        stamp: int,
        voltage: ArrayLike,
        displacement: ArrayLike,
        follows_gap: bool = False,
        settled: bool = True,
    ) -> Prediction:
        """Predict the next block and compare it with the measurement.

        Parameters
        ----------
        index : int
            Running index of the first sample, modulo 2³².
        stamp : int
            Its time [ns]; it distinguishes a restart of the driver from a late block.
        voltage : (n,) array_like
            Drive voltage [V].
        displacement : (n,) array_like
            Measured displacement [m].
        follows_gap : bool
            True if the samples missing before the block were never measured: the drive was held meanwhile.
        settled : bool
            False if the stage had been driven before the stream: the state of its hysteresis is then unknown.

        Returns
        -------
        Prediction

        Raises
        ------
        RecordError, ModelError
            If a channel is empty or not finite, or if the lengths differ; the block is then treated as lost.
        DivergenceError
            If the present model diverges. It is removed, and the history is kept.
        """
        drive, measured = samples(voltage, "voltage"), samples(displacement, "displacement")
        if drive.size != measured.size:
            raise RecordError(f"displacement: got {measured.size} samples, expected {drive.size} as in voltage")
        arrival = self.sequence.join(int(index), int(stamp), drive.size, follows_gap)
        drive, measured = drive[arrival.repeated :], measured[arrival.repeated :]
        modelled: Array | None = None
        if drive.size:
            if arrival.restarted:
                if self._history.count:
                    self._begin()
                self._joined_moving = not (settled and is_held(drive, self._history.tolerance))
                if self._joined_moving:
                    self._history.mark_unknown()
            if arrival.missing:
                self._bridge(arrival.missing, follows_gap)
            modelled = self._run_and_zero(drive, measured)
        prediction = np.empty(0) if modelled is None else modelled + self.offset
        residual = measured[: prediction.size] - prediction
        self._rms.add(residual)
        answer = Prediction(arrival.repeated, prediction, residual, self.model, self.warming_up, self._zero.so_far)
        try:
            self._advance_swap(drive.size)
        except PiezoError as error:
            return replace(answer, refused=error)
        return answer

    def _begin(self) -> None:
        newest, self._swap = self.newest_model, ModelSwap()
        self._history = VoltageHistory(self.sample_period)
        self.state: ChainState | None = None
        self._zero_from(0)
        if newest is not None:
            self.swap(newest)

    def _zero_from(self, start: int, at_rest: bool = False) -> None:
        self._zero = SensorOffset(start, samples_to_average(self.sample_period), at_rest)
        self._rms.clear()

    def _bridge(self, missing: int, never_measured: bool) -> None:
        """Bridge missing samples with the last voltage. The true voltage is unknown where messages were lost."""
        if not never_measured:
            self._history.mark_unknown()
        gap = min(missing, round(LONGEST_SILENCE / self.sample_period), FULL_SAMPLES)
        self._run(np.full(gap, self._history.last))
        if rest := missing - gap:
            self._history.hold(rest)
            if self.model is not None and self.state is not None:
                self.state = after_hold(self.model, self.state, self._history.last, rest * self.sample_period)

    def _run(self, drive: Array) -> Array | None:
        self._history.append(drive)
        if self.chain is None:
            return None
        if self.state is None:
            self.state = self.chain.rest(self._history.rest_voltage)
        try:
            modelled, self.state = self.chain.run(drive, self.state)
        except DivergenceError:
            self.model = self.chain = self.state = None
            raise
        return modelled

    def _run_and_zero(self, drive: Array, measured: Array) -> Array | None:
        start, had_rested = self._history.count, self._history.has_rested
        modelled = self._run(drive)
        if self._history.has_rested and not had_rested:
            self._zero_from(start, at_rest=True)
        elif self._joined_moving and not self.warming_up:
            self._joined_moving = False
            self._zero_from(start)
            self._zero.until = 2.0 * self._history.travel  # as long again as the part that was forgotten
        elif self._zero.at_rest and not is_held(drive, self._history.tolerance):
            self._zero.close()
        self._zero.add(measured, modelled, self._history.travel)
        return modelled

    def _advance_swap(self, received: int) -> None:
        warmup = self._swap.advance(received, self._history, self._zero)
        if warmup is None:
            return
        self.model, self.chain, self.state = warmup.model, warmup.chain, warmup.state
        self._history.tolerance = REST_TOLERANCE * warmup.model.voltage_scale
        known = warmup.known_offset(self._zero)
        self._zero_from(self._history.count)
        self._zero = known or self._zero
