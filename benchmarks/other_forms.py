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

"""Stages of another form than the models of `piezo identify`, for the benchmark of prediction.

The hysteresis consists of relays (Preisach) or of generalised plays (Prandtl-Ishlinskii with two envelopes), or follows
Bouc-Wen with the exponent 1.6 or Coleman-Hodgdon. All else is that of `benchmarks.nanopositioner`: creep, two lightly
damped modes, a pole, a delay and noise.
"""

from __future__ import annotations

import numpy as np

from benchmarks import independent_kernels as kernels
from benchmarks.nanopositioner import Nanopositioner
from benchmarks.one_amplitude import PreisachStage
from piezo_hysteresis.blocks.kernel import kernel

Array = np.ndarray


@kernel
def generalised_plays(v, radii, weights, gap):
    """Σ w_j p_j of plays between two curved envelopes, which are `gap` apart in the middle of the range."""
    out, state = np.zeros(v.size), np.zeros(radii.size)
    for i in range(v.size):
        middle = np.tanh(1.2 * v[i]) / np.tanh(1.2)
        apart = 2.0 * gap * max(0.0, v[i] * (1.0 - v[i]))
        for j in range(radii.size):
            state[j] = min(max(state[j], middle - apart - radii[j]), middle + apart + radii[j])
            out[i] += weights[j] * state[j]
    return out


@kernel
def coleman_hodgdon(v, rate, bend, loop):
    """y' = rate |v'| (f(v) − y) + v' g(v), f(v) = v + bend (v − v²), g(v) = (1 − loop) f'(v), by the midpoint rule."""
    out, y, at = np.empty(v.size), 0.0, 0.0
    for i in range(v.size):
        count = 1 + int(abs(v[i] - at) / 1e-3)  # the path of a jump is cut finely
        dv = (v[i] - at) / count
        pull = 0.5 * rate * abs(dv)
        for _ in range(count):
            at += 0.5 * dv
            f, g = at + bend * (at - at * at), (1.0 - loop) * (1.0 + bend - 2.0 * bend * at)
            y = (y * (1.0 - pull) + 2.0 * pull * f + g * dv) / (1.0 + pull)
            at += 0.5 * dv
        out[i] = y
    return out


class GeneralisedPlays(Nanopositioner):
    """Plays between envelopes of a rising and of a falling drive, which are not parallel."""

    def _hysteresis(self, v: Array) -> Array:
        radii = np.linspace(0.01, 0.45, 12)
        weights = np.exp(-radii / self.width)
        share = 1.6 * self.loop
        held = generalised_plays(v, radii, weights / weights.sum(), 0.1)
        return np.asarray((1.0 - share) * v + share * held)


class HighExponent(Nanopositioner):
    """Bouc-Wen with the exponent 1.6."""

    def _hysteresis(self, v: Array) -> Array:
        pull = 0.6 / self.width
        h = kernels.bouc_wen(v, 0.0, 1.0, -self.loop, pull, 0.5 * pull, 0.0, 0.0, 1.6, 0.0, 0.5, 0.0)
        return np.asarray((1.0 + 0.5 * self.loop) * v + self.square * v**2 + self.cubic * v**3 + h)


class ColemanHodgdon(Nanopositioner):
    """Coleman-Hodgdon; its curved middle line makes it different from Bouc-Wen."""

    def _hysteresis(self, v: Array) -> Array:
        return np.asarray(coleman_hodgdon(v, 0.5 / self.width, 0.4, self.loop))


KINDS: dict[str, type[Nanopositioner]] = {
    "relays": PreisachStage,
    "generalised plays": GeneralisedPlays,
    "Bouc-Wen, n = 1.6": HighExponent,
    "Coleman-Hodgdon": ColemanHodgdon,
}
"""Kind of a stage to its class."""


def random_stage(kind: type[Nanopositioner], seed: int) -> Nanopositioner:
    """A stage of 15 µm whose other numbers are drawn; its modes suit a sampling rate of 2 kHz."""
    rng = np.random.default_rng(seed)
    mode, zeta = float(rng.uniform(150.0, 300.0)), float(rng.uniform(0.01, 0.04))
    second = {"second_share": 0.15, "second_mode": 1.9 * mode}
    return kind.random(rng, stroke=15e-6, mode=mode, zeta=zeta, noise=5e-4, **second)
