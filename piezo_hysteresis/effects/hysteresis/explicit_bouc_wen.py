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

"""The loop of `BoucWen` with all its terms, integrated by the explicit step of Eq. (7) as some simulations do.

It is not in the catalogue, because no stage takes such steps. `identification/training/explicit_step.py` subtracts its
error from data of a simulation.
"""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.bouc_wen.bouc_wen_kernel import (
    BETA,
    EXPONENT,
    GAMMA,
    H_REFERENCE,
    PHI1,
    PHI2,
    RATE,
    RATE_EXPONENT,
    A,
    rate_factor,
)
from ...blocks.kernel import kernel
from ..effect import Discretisation, Effect
from .bouc_wen import BoucWen, BoucWenBlock


@kernel
def run_explicit(v: Array, p: Array, p1: float, p2: float, sample_period: float, state: Array, w: Array) -> None:
    """The loop with all its terms, one explicit step per sample; arguments as `run_general`."""
    h, last = state[0], state[1]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if dv != 0.0:
            last = x
            size = abs(dv)
            gain = 1.0
            if p[RATE] != 0.0:
                gain += p[RATE] * rate_factor(size / sample_period, p[RATE_EXPONENT])
            power = abs(h / H_REFERENCE) ** (p[EXPONENT] - 1.0) if p[EXPONENT] != 1.0 else 1.0
            loss = power * (p[BETA] * size * h + p[GAMMA] * dv * abs(h))
            h += gain * p[A] * dv - loss + p[PHI1] * dv * h + p[PHI2] * size * abs(h)
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1] = h, last


class ExplicitBoucWen(BoucWen):
    """The loop of `BoucWen` with its terms, integrated by the explicit step."""

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return ExplicitBlock(self, setting, terms)


class ExplicitBlock(BoucWenBlock):
    """Only for simulation: its sensitivities are those of the exact step."""

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        w, state = np.empty_like(x), state.copy()
        run_explicit(x, self.loop, self.p1, self.p2, self.sample_period, state, w)
        return w, state
