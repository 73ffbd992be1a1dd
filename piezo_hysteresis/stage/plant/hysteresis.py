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

"""Hysteresis of the piezo: an exact Bouc-Wen loop, plays, or both, from drive to normalised output.

Bouc-Wen (paper, Eq. 1 to 3) is integrated in v, not in time: for fixed signs s of dv and g of h the state obeys
dh/dv = A − q h with q = β s + γ g − φ1 − φ2 s g, whose solution is exponential; where h crosses zero the step is split.
With an exponent other than 1 there is no closed form and Runge-Kutta steps of at most 0.002 in v are taken. A play
(Prandtl-Ishlinskii operator) is exact on every monotone piece, and the amplifier moves monotonically between two
converter steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from ...errors import ParameterError
from .clock import Clock
from .quantity import Group, quantity

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class Hysteresis(Group):
    """w = p1 v³ + p2 v + even2 v² + even4 v⁴ + h + Σ c_i play(v, r_i) with v = drive / `voltage_scale`.

    At rest h = `initial_state` and every play is centred on v. The defaults are the parameters the paper identified.
    """

    voltage_scale: float = quantity(10.0, "V", 1e-6, 1e6, "drive voltage of v = 1")
    A: float = quantity(-0.7691, "1", -10.0, 10.0, "Bouc-Wen A")
    beta: float = quantity(4.6075, "1", 0.0, 100.0, "Bouc-Wen β")
    gamma: float = quantity(-0.8725, "1", -100.0, 100.0, "Bouc-Wen γ")
    p1: float = quantity(-0.1085, "1", -10.0, 10.0, "cubic part")
    p2: float = quantity(2.1925, "1", 0.0, 10.0, "linear part")
    even2: float = quantity(0.0, "1", -10.0, 10.0, "hidden effect: quadratic part")
    even4: float = quantity(0.0, "1", -10.0, 10.0, "hidden effect: quartic part")
    phi1: float = quantity(0.0, "1", -100.0, 100.0, "hidden effect: asymmetry of the loop, coefficient of dv·h")
    phi2: float = quantity(0.0, "1", -100.0, 100.0, "hidden effect: asymmetry of the loop, coefficient of |dv|·|h|")
    exponent: float = quantity(1.0, "1", 1.0, 5.0, "hidden effect: Bouc-Wen n above 1")
    reference_state: float = quantity(0.2, "1", 1e-6, 10.0, "state at which the exponent changes nothing")
    rate_gain: float = quantity(0.0, "1", -1.0, 1.0, "hidden effect: growth of the loop with ln|dv/dt|")
    rate_exponent: float = quantity(0.1, "1", 0.01, 2.0, "exponent of the rate law; near 0 it is logarithmic")
    rate_time: float = quantity(200e-6, "s", 1e-6, 1.0, "time constant of the lag on |dv/dt|")
    initial_state: float = quantity(0.0, "1", -10.0, 10.0, "hidden effect: h of the settled stage")
    backlash: float = quantity(
        0.0, "V", 0.0, 100.0, "hidden effect: half width of the backlash between drive and piezo"
    )
    play_radii: tuple[float, ...] = quantity((), "1", 0.0, 10.0, "radii r_i of plays; with Bouc-Wen a hidden effect")
    play_weights: tuple[float, ...] = quantity((), "1", -10.0, 10.0, "weights c_i of plays")

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.play_radii) != len(self.play_weights):
            raise ParameterError(
                f"hysteresis: got {len(self.play_radii)} play_radii and {len(self.play_weights)} play_weights, "
                "expected as many of each"
            )
        if self.beta < abs(self.gamma) + abs(self.phi1) + abs(self.phi2):
            raise ParameterError(
                f"hysteresis: got beta {self.beta:g} below |gamma| + |phi1| + |phi2|, expected at least that; "
                "the loop would be unbounded"
            )
        if abs(self.rate_gain) >= self.rate_exponent:
            raise ParameterError(
                f"hysteresis: got rate_gain {self.rate_gain:g}, expected less than rate_exponent "
                f"{self.rate_exponent:g}, because the loop of a slow drive would be reversed"
            )

    @classmethod
    def prandtl_ishlinskii(cls, plays: int = 14) -> Hysteresis:
        """A Prandtl-Ishlinskii operator in place of Bouc-Wen, with a loop of about the same width.

        Parameters
        ----------
        plays : int
            Number of plays, radii on a geometric grid from 0.008 to 0.4, weights of an exponential density.
        """
        edges = np.geomspace(0.006, 0.45, plays + 1)
        radii = np.sqrt(edges[:-1] * edges[1:])
        weights = 8.0 * np.exp(-radii / 0.11) * np.diff(edges)
        off = replace(cls(), A=0.0, beta=0.0, gamma=0.0, p2=1.45)
        return replace(off, play_radii=tuple(radii.tolist()), play_weights=tuple(weights.tolist()))

    def rise(self, start: float, stop: float) -> float:
        """Change of w when the settled operator is driven from `start` to `stop` [V]; the rate has no influence."""
        operator = Operator(replace(self, rate_gain=0.0), Clock.cut(1.0, 0.0, 1.0), start)
        return float(operator.run(np.linspace(start, stop, 1001))[-1] - operator.rest)


class Operator:
    """State of the hysteresis, settled at a drive of `voltage` [V]."""

    def __init__(self, hysteresis: Hysteresis, clock: Clock, voltage: float) -> None:
        p = hysteresis
        v = voltage / p.voltage_scale
        self._scale = p.voltage_scale
        self._polynomial = np.array([p.p2, p.even2, p.p1, p.even4])
        self._loop = np.array([p.A, p.beta, p.gamma, p.phi1, p.phi2, p.exponent, p.reference_state])
        self._rate = np.array([p.rate_gain, p.rate_exponent, p.rate_time])
        self._backlash = p.backlash / p.voltage_scale
        self._radii, self._weights = np.array(p.play_radii), np.array(p.play_weights)
        self._plays = np.full(len(p.play_radii), v)
        self._state = np.array([v, p.initial_state, 0.0])
        self._step = np.array(clock.steps)[clock.kind]
        v2 = v * v
        self.rest = float(
            v * (p.p2 + v * p.even2 + v2 * p.p1 + v2 * v * p.even4) + p.initial_state + self._weights @ self._plays
        )

    def run(self, voltage: Samples) -> Samples:
        """Normalised output w at the end of every sub-step, for the drive at the piezo there [V]."""
        w = np.empty_like(voltage)
        _hysteresis(
            voltage / self._scale, self._polynomial, self._loop, self._rate, self._backlash, self._radii, self._weights,
            self._step, self._state, self._plays, w,
        )  # fmt: skip
        return w


@kernel
def _play(z: float, v: float, r: float) -> float:
    return min(max(z, v - r), v + r)


@kernel
def _fallen(x: float) -> float:
    """1 − exp(−x) from its series, exact to the last digit; expm1 would take most of the time of the whole plant."""
    if abs(x) > 0.01:
        return -math.expm1(-x)
    return x * (1.0 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720))))))


@kernel
def _exponential_step(h, dv, a, beta, gamma, phi1, phi2):
    s = math.copysign(1.0, dv)
    while dv != 0.0:
        g = math.copysign(1.0, h) if h != 0.0 else math.copysign(1.0, a * s)
        q = beta * s + gamma * g - phi1 - phi2 * s * g
        if q == 0.0:
            return h + a * dv
        end = h - (h - a / q) * _fallen(q * dv)
        if h == 0.0 or end * g >= 0.0:
            return end
        dv -= math.log1p(-h * q / a) / q if a != 0.0 else dv
        h = 0.0
        if dv * s <= 0.0:
            return h
    return h


@kernel
def _slope(h, a, s, beta, gamma, phi1, phi2, exponent, reference):
    g = math.copysign(1.0, h)
    return a - ((beta * s + gamma * g) * abs(h / reference) ** (exponent - 1.0) - phi1 - phi2 * s * g) * h


@kernel
def _runge_kutta_step(h, dv, a, beta, gamma, phi1, phi2, exponent, reference):
    n = int(abs(dv) / 0.002) + 1
    d = dv / n
    s = math.copysign(1.0, dv)
    for _ in range(n):
        k1 = _slope(h, a, s, beta, gamma, phi1, phi2, exponent, reference)
        k2 = _slope(h + 0.5 * d * k1, a, s, beta, gamma, phi1, phi2, exponent, reference)
        k3 = _slope(h + 0.5 * d * k2, a, s, beta, gamma, phi1, phi2, exponent, reference)
        k4 = _slope(h + d * k3, a, s, beta, gamma, phi1, phi2, exponent, reference)
        h += d * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return h


@kernel
def _hysteresis(voltage, polynomial, loop, rate_law, backlash, radii, weights, step, state, plays, w):
    a0, beta, gamma, phi1, phi2, exponent, reference = loop[0], loop[1], loop[2], loop[3], loop[4], loop[5], loop[6]
    p2, e2, p1, e4 = polynomial[0], polynomial[1], polynomial[2], polynomial[3]
    rate_gain, rate_exponent, rate_time = rate_law[0], rate_law[1], rate_law[2]
    v, h, rate = state[0], state[1], state[2]
    count = step.size
    forget = np.empty(count)
    for j in range(count):
        forget[j] = -math.expm1(-step[j] / rate_time)
    k = 0
    for i in range(voltage.size):
        moved = _play(v, voltage[i], backlash) if backlash > 0.0 else voltage[i]
        dv = moved - v
        v = moved
        a = a0
        if rate_gain != 0.0:
            rate += forget[k] * (abs(dv) / step[k] - rate)
            if rate < 1e-12:
                rate = 0.0
            a = a0 * (1.0 + rate_gain * (rate**rate_exponent - 1.0) / rate_exponent)
        if dv != 0.0:
            if exponent == 1.0:
                h = _exponential_step(h, dv, a, beta, gamma, phi1, phi2)
            else:
                h = _runge_kutta_step(h, dv, a, beta, gamma, phi1, phi2, exponent, reference)
            for j in range(plays.size):
                plays[j] = _play(plays[j], v, radii[j])
        total = 0.0
        for j in range(plays.size):
            total += weights[j] * plays[j]
        v2 = v * v
        w[i] = v * (p2 + v * e2 + v2 * p1 + v2 * v * e4) + h + total
        k = k + 1 if k + 1 < count else 0
    state[0], state[1], state[2] = v, h, rate
