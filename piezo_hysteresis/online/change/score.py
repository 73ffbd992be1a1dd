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

"""`Scores`: the residual multiplied by the sensitivities of the running model, summed over blocks of the stream.

A change θ of the parameters moves the residual e by Sᵀ θ, where the rows of S are the sensitivities of the predicted
displacement. The score z = S e / √B of a block of B samples is then M θ on average, with M = S Sᵀ / √B (the local
approach: Benveniste, Basseville, Moustakides, IEEE Trans. Autom. Control 32 (1987) 583). S has the shape (5, B).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.arx import ORDER, recur
from ...model.chain import Chain, ChainState, ChainTangent
from ...model.model import Model

Array = NDArray[np.float64]

GROUPS = ("gain", "loop", "dynamics", "slow", "offset")
"""Groups of parameters, in the order of the rows of S.

gain: all of the displacement [1]. loop: height of the hysteresis loop [1]. dynamics: lag of the displacement [s].
slow: displacement that follows with a time constant of `SLOW_TIME` [1]. offset: zero of the sensor [m].
"""

UNITS = ("1", "1", "s", "1", "m")
"""Units of a change of each group."""

BLOCK_TIME = 0.1
"""Time that one score covers [s], unless these are fewer than `FEWEST_SAMPLES`."""

FEWEST_SAMPLES = 16
"""Fewest samples that one score covers."""

SLOW_TIME = 3.0
"""Time constant of the slow group [s]."""

_OFFSET = GROUPS.index("offset")
"""Row of the offset."""


@dataclass(frozen=True, eq=False, slots=True)
class ChangeScore:
    """Score of one block of the stream.

    Parameters
    ----------
    value : (5,) ndarray
        z = S e / √B, in the units of the rows times metres.
    slope : (5, 5) ndarray
        M = S Sᵀ / √B: the derivative of the mean of z with respect to the parameters.
    span, speed : float
        Peak-to-peak of the drive voltage [V], and rms of its rate of change [V/s].
    stamp : int
        Time of the last sample [ns].
    power : float
        Mean square of the residual [m²].
    duration : float
        Time that the block covers [s].
    """

    value: Array
    slope: Array
    span: float
    speed: float
    stamp: int
    power: float
    duration: float = BLOCK_TIME

    @property
    def offset(self) -> float:
        """Mean residual of the block [m]."""
        return float(self.value[_OFFSET] / self.slope[_OFFSET, _OFFSET])


def loop_heights(model: Model) -> dict[str, float]:
    """Values of the parameters that together scale the height of the hysteresis loop, by `effect.parameter`."""
    values = model.values()
    names = [f"{effect.name}.{number}" for effect in model.effects for number in effect.loop_numbers()]
    return {name: values[name] for name in names if values[name]}


def block_size(sample_period: float) -> int:
    """Number of samples that one score covers, at a given sample period [s]."""
    return max(FEWEST_SAMPLES, round(BLOCK_TIME / sample_period))


class Scores:
    """Computes the scores of the stream of a predictor.

    Parameters
    ----------
    chain : Chain
        The running model at the sample period of the stream.
    state : ChainState
        Its state before the next sample.
    loop : mapping of str to float
        `loop_heights` of the model.
    tangent : ChainTangent
        Sensitivities to these parameters before the next sample; `Chain.rest_tangent` if they are unknown.
    unused : int
        Number of samples before the first block.
    """

    def __init__(
        self, chain: Chain, state: ChainState, loop: Mapping[str, float], tangent: ChainTangent, unused: int = 0
    ) -> None:
        self._chain, self._state, self._tangent = chain, state, tangent
        self._loop, self._weights = tuple(loop), np.array([*loop.values()])
        self._period = chain.setting.sample_period
        self.block_size = block_size(self._period)
        self._decay = float(np.exp(-self._period / SLOW_TIME))
        self._rows: list[Array] = []
        self._held, self._unused = 0, unused
        self._last: tuple[float, float, float] | None = None  # prediction, slow, voltage

    def add(self, voltage: Array, residual: Array, stamp: int) -> list[ChangeScore]:
        """Add the next samples, and return the scores that they complete.

        Parameters
        ----------
        voltage : (n,) ndarray
            Drive voltage [V].
        residual : (n,) ndarray
            Measured minus predicted displacement [m].
        stamp : int
            Time of the last of these samples [ns].

        Returns
        -------
        list of ChangeScore
        """
        y, names, rows, self._state, self._tangent = self._chain.linearise(
            voltage, self._state, self._tangent, self._loop
        )
        order = [self._loop.index(n) for n in names]
        loop = self._weights[order] @ rows if names else np.zeros(y.size)
        first, slow, before = self._last or (float(y[0]), float(y[0]), float(voltage[0]))
        lag = -np.diff(y, prepend=first) / self._period
        follows = _low_pass(y, self._decay, slow)
        self._last = (float(y[-1]), float(follows[-1]), float(voltage[-1]))
        speed = np.diff(voltage, prepend=before) / self._period
        new = np.vstack((y, loop, lag, follows, np.ones(y.size), residual, voltage, speed))[:, self._unused :]
        self._unused = max(0, self._unused - y.size)
        self._rows.append(new)
        self._held += new.shape[1]
        done: list[ChangeScore] = []
        while self._held >= self.block_size:
            rows = np.hstack(self._rows)
            after = round((self._held - self.block_size) * self._period * 1e9)
            done.append(_score(rows[:, : self.block_size], stamp - after, self._period))
            rest = rows[:, self.block_size :].copy()
            self._rows, self._held = [rest], rest.shape[1]
        return done


def _low_pass(x: Array, decay: float, before: float) -> Array:
    """y_i = (1 − decay) x_i + decay y_(i − 1), shape (n,); `before` is y before the first sample."""
    poles, state, y = np.zeros(ORDER), np.zeros(ORDER), np.empty_like(x)
    poles[0], state[0] = -decay, before
    recur(poles, state, (1.0 - decay) * x, 0.0, y)
    return y


def _score(rows: Array, stamp: int, sample_period: float) -> ChangeScore:
    s, e, voltage, speed = rows[:5], rows[5], rows[6], rows[7]
    root = np.sqrt(e.size)
    fast, power = float(np.sqrt(np.mean(speed**2))), float(np.mean(e**2))
    duration = e.size * sample_period
    return ChangeScore(s @ e / root, s @ s.T / root, float(np.ptp(voltage)), fast, stamp, power, duration)
