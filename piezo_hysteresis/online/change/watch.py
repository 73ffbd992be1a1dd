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
from .baseline import Baseline
from .detector import Change, ChangeDetector
from .false_alarm_threshold import CLEARED
from .score import ChangeScore, Scores, loop_heights

Array = NDArray[np.float64]


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
    since : int
        Stamp at which the present change began [ns]; 0 while there is none.
    groups : tuple of str
        Groups of parameters that explained the present or the last change best, over the longest time.
    alarms : int
        Number of changes detected so far.

    Raises
    ------
    ParameterError
        If the interval is not positive.
    ModelError
        Raised by `add` if the requested baseline cannot be computed.

    Notes
    -----
    After a change of model or a gap, all scores are discarded and the baseline is kept.
    """

    def __init__(self, false_alarm_interval: float, baseline: Baseline | None = None) -> None:
        if not 0.0 < false_alarm_interval < math.inf:
            raise ParameterError(f"false_alarm_interval: got {false_alarm_interval:g} s, expected a time above 0 s")
        self._interval = false_alarm_interval
        self.baseline = baseline
        self.change, self.since, self.alarms = Change(), 0, 0
        self.groups: tuple[str, ...] = ()
        self._best = (0, 0.0)
        self._model: Model | None = None
        self._hash = ""
        self._scores: Scores | None = None
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

    def restart(self) -> None:
        """Discard all scores, because the sensor offset was measured again or samples were lost."""
        self._scores = None

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
        is_idle = self.baseline is None and not self.is_taking
        if is_idle or answer.model is None or answer.warming_up or answer.residual.size == 0:
            self.restart()
            return None
        if self._scores is None or answer.model is not self._model:
            self._follow(answer.model, predictor, float(voltage[-1]))
            return None
        completed = None
        for score in self._scores.add(voltage, answer.residual, stamp):
            completed = self._score(score) or completed
        return completed

    def _follow(self, model: Model, predictor: Predictor, voltage: float) -> None:
        chain, state = predictor.chain, predictor.state
        if chain is None or state is None:
            return
        if self._model is not None and model is not self._model:
            self.since, self._wanted = 0, 0.0
        self._model, self._hash = model, model_hash(model)
        loop = loop_heights(model)
        self._scores = Scores(chain, state, loop, chain.rest_tangent(voltage, loop, state.time))
        self._watch(self.baseline, same_offset=False)

    def _watch(self, baseline: Baseline | None, *, same_offset: bool) -> None:
        self.change, self._detector = Change(), None
        if baseline is not None and baseline.model == self._hash:
            self._detector = ChangeDetector(baseline, self._interval, same_offset=same_offset)

    def _score(self, score: ChangeScore) -> Baseline | None:
        if self._wanted:
            self._taken.append(score)
            if len(self._taken) < round(self._wanted / score.duration):
                return None
            taken, self._wanted, self._taken = self._taken, 0.0, []
            self.baseline = Baseline.of(taken, self._hash)
            self.since = 0
            self._watch(self.baseline, same_offset=True)
            return self.baseline
        if self._detector is not None:
            self.change = self._detector.add(score)
            if self.change.statistic > 1.0 and not self.since:
                self.since, self.alarms = self.change.onset, self.alarms + 1
                self._best = (0, 0.0)
            elif self.change.watched and self.change.statistic < CLEARED:
                self.since = 0
            known = score.stamp - self.change.onset, self.change.statistic
            if self.since and self.change.statistic > 1.0 and known > self._best:
                self._best, self.groups = known, self.change.groups
        return None


def baseline_path(folder: Path, model: str) -> Path:
    """Path of the file in a folder that contains the baseline of a model, given by its hash."""
    return folder / f"baseline_{model.partition(':')[2]}.npz"
