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

"""Creep: a fine bank of Kelvin-Voigt elements in series with the piezo.

Each element relaxes towards w with its own time; together they make the step response logarithmic,
L(t) = L(0.1 s) [1 + γ log10(t / 0.1 s)], fractional (weights ∝ τ^λ), or any given sum of exponentials
(Croft, Shed, Devasia 2001). Inputs are taken as linear over a sub-step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from ...errors import ParameterError
from .clock import Clock
from .quantity import Group, quantity

Samples = NDArray[np.float64]

REFERENCE_TIME = 0.1
"""Time after a step at which the displacement with creep equals that without creep [s]."""

_ELEMENTS_PER_DECADE = 4
"""Kelvin-Voigt elements per decade of time."""


@dataclass(frozen=True)
class PlantCreep(Group):
    """Hidden effect: the displacement continues to grow after each change of level."""

    gamma: float = quantity(0.0, "1/decade", -0.1, 0.1, "growth of the step response per decade at 0.1 s")
    slope: float = quantity(0.0, "1", -0.5, 0.5, "λ of the weights τ^λ; 0 for logarithmic creep")
    shortest_time: float = quantity(20e-6, "s", 1e-7, 0.01, "fastest element of the bank")
    longest_time: float = quantity(1e5, "s", 1.0, 1e8, "slowest element of the bank")
    times: tuple[float, ...] = quantity((), "s", 1e-6, 1e8, "exponential creep: relaxation times")
    weights: tuple[float, ...] = quantity((), "1", -1.0, 1.0, "exponential creep: final growth by each element")

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.times) != len(self.weights):
            raise ParameterError(
                f"creep: got {len(self.times)} times and {len(self.weights)} weights, expected as many of each"
            )

    def elements(self) -> tuple[Samples, Samples, float]:
        """Relaxation times [s] and weights of all elements, and the factor that keeps the response at 0.1 s."""
        if self.gamma == 0.0:
            return np.array(self.times), np.array(self.weights), 1.0
        exponents = np.arange(
            math.log10(self.shortest_time), math.log10(self.longest_time) + 1e-9, 1 / _ELEMENTS_PER_DECADE
        )
        tau = 10.0**exponents
        shape = (tau / REFERENCE_TIME) ** self.slope / _ELEMENTS_PER_DECADE
        grown = float(shape @ -np.expm1(-REFERENCE_TIME / tau))
        start = 1.0 - self.gamma * grown
        if start <= 0.0:
            raise ParameterError(
                f"creep: got gamma {self.gamma:g} with slope {self.slope:g}, expected a response that starts above "
                "zero; take a smaller gamma"
            )
        return np.r_[tau, self.times], np.r_[self.gamma * shape / start, self.weights], start


class Bank:
    """State of the creep, settled at the normalised output `w`: every element is relaxed."""

    def __init__(self, creep: PlantCreep, clock: Clock, w: float) -> None:
        tau, weight, start = creep.elements()
        self.active = tau.size > 0
        self._start = start
        self._kind = clock.kind
        steps = np.array(clock.steps)[:, None] / np.where(tau, tau, 1.0)
        lost = -np.expm1(-steps)
        # x1 = decay x0 + early w0 + late w1: exact for a straight line from w0 to w1 over the sub-step
        self._decay = 1.0 - lost
        self._late = weight * (1.0 - lost / steps)
        self._early = weight * (lost / steps - self._decay)
        self._state = weight * w
        self._last = np.array([w])
        self.rest = start * (w + float(self._state.sum()))

    def run(self, w: Samples) -> Samples:
        """Output with creep at the end of every sub-step; exactly `w` when there is no element."""
        if not self.active:
            return w
        out = np.empty_like(w)
        _relax(w, self._kind, self._decay, self._early, self._late, self._start, self._state, self._last, out)
        return out


@kernel
def _relax(w, kind, decay, early, late, start, state, last, out):
    w0 = last[0]
    size = state.size
    k = 0
    for i in range(w.size):
        w1 = w[i]
        part = kind[k]
        for j in range(size):
            state[j] = decay[part, j] * state[j] + early[part, j] * w0 + late[part, j] * w1
        # four running sums, because one would wait for every addition
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(0, size - 3, 4):
            a += state[j]
            b += state[j + 1]
            c += state[j + 2]
            d += state[j + 3]
        for j in range(size - size % 4, size):
            a += state[j]
        out[i] = start * (w1 + ((a + b) + (c + d)))
        w0 = w1
        k = k + 1 if k + 1 < kind.size else 0
    last[0] = w0
