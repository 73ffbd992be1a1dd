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

"""`learn`: plays a path, measures the error and corrects the drive, repeatedly, until the error is noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..model.chain import ChainState
from ..model.model import Model
from ..model.samples import samples
from .learning_filter import LearningFilter, ResponseCheck
from .limits import Limits
from .plan import Plan, plan

Array = NDArray[np.float64]

AT_NOISE = 1.1
"""The error counts as noise if its RMS in the band of the filter is below this multiple of the noise in this band."""


@dataclass(frozen=True, eq=False, slots=True)
class LearningRound:
    """Measurement of one round.

    Parameters
    ----------
    plan : Plan
        Plan that was played.
    measured : (n,) ndarray
        Displacement along the path [m].
    rms : float
        RMS error along the path, including the noise [m].
    expected : float
        RMS error that was predicted before the round [m].
    """

    plan: Plan
    measured: Array
    rms: float
    expected: float


def default_filter(model: Model) -> LearningFilter:
    """Filter with full gain up to 1.2 kHz at 50 kHz sampling, in proportion at other rates.

    The gain is zero where the identified dynamics G are too uncertain.
    """
    rate = 1.0 / model.sample_period
    check = ResponseCheck.of(model, np.geomspace(1e-5 * rate, 0.06 * rate, 60))
    return LearningFilter(model.sample_period, 0.024 * rate, 0.06 * rate, check=check)


class IterativeLearning:
    """Corrects the reference of a path by the measured error, round by round.

    The inverse of the model computes the drive for the corrected reference. The inverse compensates hysteresis, creep
    and dynamics, so a round only removes errors of the model.

    Parameters
    ----------
    model : Model
        Model of the stage.
    first : Plan
        First plan of the path; all rounds use its band.
    limits : Limits
        Limits of the drive.
    filter : LearningFilter, optional
        Default: `default_filter`.
    noise : float
        RMS sensor noise [m]. Learning ends when the error is not larger.
    approximate : bool
        As for `plan`.
    """

    def __init__(
        self,
        model: Model,
        first: Plan,
        limits: Limits,
        filter: LearningFilter | None = None,
        *,
        noise: float = 0.0,
        approximate: bool = False,
    ) -> None:
        if not noise >= 0.0:
            raise ModelError(f"noise: got {noise!r} m, expected zero or more")
        self.filter = filter or default_filter(model)
        self.model, self.limits, self.noise, self.approximate = model, limits, noise, approximate
        self.wanted = first.wanted
        self.next: Plan | None = first
        """Plan to play next; None when learning has ended, for the reason in `reason`."""
        self.reason = ""
        self.rounds: list[LearningRound] = []
        self._reference = first.wanted.copy()
        self._expected: float | None = None

    @property
    def expected(self) -> float:
        """RMS error that `next` is expected to have along the path, as the rounds before predict it [m].

        Raises
        ------
        ModelError
            If learning has ended.
        """
        if self.next is None:
            raise ModelError(f"learning: has ended ({self.reason}), expected no question about a next round")
        return self.next.expected.total if self._expected is None else self._expected

    @property
    def best(self) -> LearningRound:
        """The round with the smallest measured error."""
        return min(self.rounds, key=lambda r: r.rms)

    def update(self, measured: Array, start: ChainState | None = None) -> Plan | None:
        """Store the measurement of the plan `next`, and plan another round if it is predicted to be better.

        Parameters
        ----------
        measured : (m,) ndarray
            Displacement at every sample of the drive of `next` [m].
        start : ChainState, optional
            State of the model before the next round. Default: that before this one.

        Returns
        -------
        Plan or None
            Plan of the next round; None if learning has ended.

        Raises
        ------
        ModelError
            If the number of samples is wrong, or learning has ended.
        """
        if self.next is None:
            raise ModelError(f"learning: has ended ({self.reason}), expected no more measurements")
        y = samples(measured, "displacement")
        played = self.next
        if y.size != played.voltage.size:
            raise ModelError(f"learning: got {y.size} samples, expected the {played.voltage.size} of the drive")
        along = y[played.begin : played.begin + self.wanted.size]
        error = self.wanted - along
        before = self.rounds[-1] if self.rounds else None
        self.rounds.append(LearningRound(played, along, float(np.sqrt(np.mean(error**2))), self.expected))
        if before is not None and self.rounds[-1].rms >= before.rms:
            self._end("the last round was no better than the one before")
            return None
        correction, left, now = self.filter.correct(error, self.noise)
        if now <= self.noise * np.sqrt(max(AT_NOISE**2 - 1.0, 0.0)) * self._share_of_band():
            self._end("the error is at the noise of the sensor")
            return None
        if left >= now:
            self._end("another round is predicted to be no better")
            return None
        self._reference = self._reference + correction
        following = plan(
            self.model, self._reference, self.limits,
            start=start or played.start, band=played.band, approximate=self.approximate,
            approach=(played.begin - played.preview) * played.sample_period,
            way_back=(played.voltage.size - played.begin - played.wanted.size) * played.sample_period,
        )  # fmt: skip
        if not following.reachability.is_whole and played.reachability.is_whole:
            self._end("the limits of the drive do not allow the corrected path")
            return None
        self._expected = float(np.sqrt(max(self.rounds[-1].rms ** 2 - now**2, 0.0) + left**2))
        self.next = following
        return following

    def _end(self, reason: str) -> None:
        self.next, self.reason = None, reason

    def _share_of_band(self) -> float:
        """RMS of white noise in the band of the filter, relative to the RMS of the whole noise."""
        frequency = np.linspace(0.0, 0.5 / self.model.sample_period, 1000)
        return float(np.sqrt(np.mean(self.filter.at(frequency) > 0.0)))


def learn(learning: IterativeLearning, play: Callable[[Array], Array], rounds: int = 2) -> IterativeLearning:
    """Play the first plan and up to `rounds` corrections of it.

    Parameters
    ----------
    learning : IterativeLearning
        Learning with its first plan.
    play : callable
        Plays a drive (m,) [V] on the stage, settled at the voltage of the plan's start, and returns the displacement
        (m,) [m].
    rounds : int
        Largest number of corrections.

    Returns
    -------
    IterativeLearning
        The given object, with its rounds.
    """
    for _ in range(rounds + 1):
        if learning.next is None:
            break
        learning.update(play(learning.next.voltage))
    return learning
