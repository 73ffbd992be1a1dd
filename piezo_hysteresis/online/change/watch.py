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

"""`ChangeWatch`: follows a predictor and reports whether the stage still agrees with its model and its baseline."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import ParameterError
from ...model.model import Model
from ...model.model_parameters import model_hash
from ..prediction import Prediction
from ..predictor import Predictor
from ..sensor_offset import SensorOffset
from .baseline import Baseline
from .detector import Change, ChangeDetector
from .false_alarm_threshold import CLEARED
from .score import ChangeScore, Scores, block_size, loop_heights

Array = NDArray[np.float64]

_SAME_PERIOD = 0.01
"""Largest relative difference between the sample period of a stream and that of its baseline."""

_ZERO, _OTHER_DRIVE = "the zero of the sensor is being measured", "the present drive was not part of the baseline"
"""Reasons for `ChangeWatch.blind`."""


class ChangeWatch:
    """Scores, baseline and detector of one stream.

    Parameters
    ----------
    false_alarm_interval : float
        Wanted mean time between false alarms [s].
    baseline : Baseline, optional
        Baseline of an earlier session. It is used while the model with which it was taken is running.

    Attributes
    ----------
    change : Change
        Result of the detector for the newest score.
    compared : Change
        The newest result with a statistic; unlike `change`, it remains while the watch is blind.
    since : int
        Stamp at which the present change began [ns]; 0 while there is none.
    groups : tuple of str
        Groups of parameters that explained the present or the last change best, over the longest time.
    alarms : int
        Number of changes detected so far.
    blind : str
        Why the newest samples are not compared with the baseline; empty while they are.

    Raises
    ------
    ParameterError
        If the interval is not positive.
    ModelError
        Raised by `add` if the requested baseline cannot be computed.

    Notes
    -----
    After a change of model, a gap, or a new measurement of the sensor offset, all scores are discarded and the baseline
    is kept.
    """

    def __init__(self, false_alarm_interval: float, baseline: Baseline | None = None) -> None:
        if not 0.0 < false_alarm_interval < math.inf:
            raise ParameterError(f"false_alarm_interval: got {false_alarm_interval:g} s, expected a time above 0 s")
        self._interval = false_alarm_interval
        self.baseline = baseline
        self.change, self.compared, self.since, self.alarms = Change(), Change(), 0, 0
        self.groups: tuple[str, ...] = ()
        self._best = (0, 0.0)
        self.blind = _ZERO
        self._model: Model | None = None
        self._hash, self._period = "", 0.0
        self._zeroing: tuple[SensorOffset, int] | None = None
        self._scores: Scores | None = None
        self._last = 0  # stamp of the end of a block of the scores [ns]
        self._detector: ChangeDetector | None = None
        self._wanted = 0.0
        self._taken: list[ChangeScore] = []

    @property
    def is_taking(self) -> bool:
        """Whether a baseline is being taken."""
        return self._wanted > 0.0

    def take_baseline(self, duration: float) -> None:
        """Take a baseline over the next `duration` of the stream [s]; when complete, it replaces the old one.

        Raises
        ------
        ParameterError
            If the duration is not positive.
        """
        if not 0.0 < duration < math.inf:
            raise ParameterError(f"baseline: got a duration of {duration:g} s, expected a finite time above 0 s")
        self._wanted, self._taken = duration, []

    def add(self, voltage: Array, answer: Prediction, predictor: Predictor, stamp: int) -> Baseline | None:
        """Compare one block of the stream with the baseline, or add it to the baseline that is being taken.

        Parameters
        ----------
        voltage : (n,) ndarray
            Drive voltage of the samples that `answer` predicts [V].
        answer : Prediction
            Output of the predictor.
        predictor : Predictor
            The predictor after this block.
        stamp : int
            Time of the last sample [ns].

        Returns
        -------
        Baseline or None
            Baseline that this block completed, if any.
        """
        if answer.zeroing != self._zeroing:  # also in a new stream: the residual has another mean from here on
            self._zeroing, self._taken, self._scores, self.blind = answer.zeroing, [], None, _ZERO
            return None
        is_idle = self.baseline is None and not self.is_taking
        if is_idle or answer.model is None or answer.warming_up or answer.residual.size == 0:
            self._scores, self.blind = None, "voltages that were not received still influence the prediction"
            return None
        if self._scores is None or answer.model is not self._model:
            self._follow(answer.model, predictor, float(voltage[-1]), stamp)
            return None
        completed = None
        for score in self._scores.add(voltage, answer.residual, stamp):
            self._last = score.stamp
            completed = self._score(score) or completed
        return completed

    def _follow(self, model: Model, predictor: Predictor, voltage: float, stamp: int) -> None:
        chain, state = predictor.chain, predictor.state
        if chain is None or state is None:
            return
        if self._model is not None and model is not self._model:
            self.since, self._wanted = 0, 0.0
        self._model, self._hash, self._period = model, model_hash(model), predictor.sample_period
        loop = loop_heights(model)
        # blocks at another phase of a periodic drive have another misfit than those of the baseline
        size, since = block_size(self._period), round((stamp - self._last) * 1e-9 / self._period) if self._last else 0
        self._scores = Scores(chain, state, loop, chain.rest_tangent(voltage, loop, state.time), -since % size)
        self._watch(self.baseline, same_offset=False)

    def _watch(self, baseline: Baseline | None, *, same_offset: bool) -> None:
        self.change, self._detector, self.blind = Change(), None, _ZERO
        if baseline is None or baseline.model != self._hash:
            return
        if math.isclose(baseline.sample_period, self._period, rel_tol=_SAME_PERIOD):
            self._detector = ChangeDetector(baseline, self._interval, same_offset=same_offset)
        else:
            self.blind = (
                f"the baseline was taken at {baseline.sample_period:g} s per sample, and the stream has "
                f"{self._period:g} s; call ~/baseline while the stage is known to be good"
            )

    def _score(self, score: ChangeScore) -> Baseline | None:
        if self._wanted:
            self._taken.append(score)
            if len(self._taken) < round(self._wanted / score.duration):
                return None
            taken, self._wanted, self._taken = self._taken, 0.0, []
            self.baseline = Baseline.of(taken, self._hash, self._period)
            self.since = 0
            self._watch(self.baseline, same_offset=True)
            return self.baseline
        if self._detector is not None:
            self.change = self._detector.add(score)
            is_compared = bool(self.change.groups)
            self.compared = self.change if is_compared else self.compared
            self.blind = "" if is_compared else _ZERO if self.change.watched else _OTHER_DRIVE
            if self.change.statistic > 1.0 and not self.since:
                self.since, self.alarms = self.change.onset, self.alarms + 1
                self._best = (0, 0.0)
            elif is_compared and self.change.statistic < CLEARED:
                self.since = 0
            known = score.stamp - self.change.onset, self.change.statistic
            if self.since and self.change.statistic > 1.0 and known > self._best:
                self._best, self.groups = known, self.change.groups
        return None


def baseline_path(folder: Path, model: str) -> Path:
    """Path of the file in a folder that contains the baseline of a model, given by its hash."""
    return folder / f"baseline_{model.partition(':')[2]}.npz"
