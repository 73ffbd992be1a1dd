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

"""Other ways to drive a stage along a path, for the benchmark of compensation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piezo_hysteresis.blocks.kernel import kernel
from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.effects import Arx, BoucWen, ChainPosition
from piezo_hysteresis.model.model import Model


def linear_gain(wanted: np.ndarray, stroke: float, voltage: float) -> np.ndarray:
    """Voltage in proportion to the displacement, by the stroke [m] that `voltage` gives."""
    return np.clip(wanted * voltage / stroke, 0.0, voltage)


def hysteresis_alone(model: Model, wanted: np.ndarray, limits: Limits) -> np.ndarray:
    """Inverse of hysteresis and creep behind a stage without dynamics: the gain of the model at dc, and no delay."""
    chain = model.at(model.sample_period)
    kept = [e for e in model.effects if e.place is not ChainPosition.DYNAMICS and e.host != Arx.name]
    gain = 1.0
    for label, block in zip(chain.labels, chain.blocks, strict=True):
        if label in {e.name for e in model.effects if e.place is ChainPosition.DYNAMICS}:
            gain *= block.static_slopes(0.0)[0]
    static = replace(model, effects=(*kept, Arx(b=[gain], delay=1.0)))
    inverse = Inverse(static, limits)
    u, _ = inverse.command(wanted, inverse.rest(0.0))
    return u[inverse.preview :]


@kernel
def run_multiplicative(w, a, beta, gamma, p1, p2, low, high, v):
    """v_i = (w_i − h_(i−1) − p1 v_(i−1)³)/p2 with the explicit loop of the paper, Eq. (7); v (n,) is filled."""
    h, last = 0.0, 0.0
    for i in range(w.size):
        x = min(max((w[i] - h - p1 * last * last * last) / p2, low), high)
        dv = x - last
        h += a * dv - beta * abs(dv) * h - gamma * dv * abs(h)
        last = x
        v[i] = x


def multiplicative(model: Model, wanted: np.ndarray, limits: Limits) -> np.ndarray:
    """The multiplicative structure of Rakotondrabe 2011: the last state of the loop is subtracted."""
    loop, scale = model["bouc_wen"], model.voltage_scale
    arx = model["arx"]
    assert isinstance(arx, Arx) and isinstance(loop, BoucWen)
    a, beta, gamma, p1, p2 = (loop[n] for n in ("A", "beta", "gamma", "p1", "p2"))
    v = np.empty_like(wanted)
    w = wanted / (arx.dc_gain * model.displacement_scale)
    run_multiplicative(w, a, beta, gamma, p1, p2, limits.voltage_min / scale, limits.voltage_max / scale, v)
    return scale * v
