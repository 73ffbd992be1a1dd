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

"""Mechanics: two modes, an optional third, softening, and the poles of the sensor, in one state space.

They are discretised exactly by matrix exponentials for the real shape of w: between two converter steps the amplifier
output, and with it w, approaches its end exponentially with the amplifier's time constant. The curvature of the
hysteresis within one sub-step is neglected, and the force of softening is taken as linear there. Both errors are of
second order in a step that is a fraction of a sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import expm

from ...blocks.kernel import kernel
from ...errors import ParameterError
from .clock import Clock
from .quantity import Group, quantity

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class Structure(Group):
    """Mechanics: a parallel sum of modes, x = `dc_gain` · `displacement_scale` · Σ share_i M_i(s) w.

    M_i(s) is the transfer function of mode i, 1 at s = 0. The default frequencies and dampings were fitted, together
    with the electronics and the sensor, to the frequency and step response of the published ARX model (paper,
    Sec. 3.3): its dc gain, its group delay of 98.5 µs near dc, and its onset 60 µs after a step.
    """

    dc_gain: float = quantity(0.24641, "1", 1e-6, 1e6, "normalised displacement over w of the settled stage")
    displacement_scale: float = quantity(100e-6, "m", 1e-9, 1.0, "displacement at normalised displacement 1")
    frequency1: float = quantity(11150.0, "Hz", 1.0, 1e6, "natural frequency of the first mode")
    damping1: float = quantity(0.1855, "1", 1e-4, 1.0, "damping ratio of the first mode")
    share1: float = quantity(0.843, "1", -2.0, 2.0, "share of the first mode in the static displacement")
    frequency2: float = quantity(12180.0, "Hz", 1.0, 1e6, "natural frequency of the second mode")
    damping2: float = quantity(0.0248, "1", 1e-4, 1.0, "damping ratio of the second mode")
    softening_quadratic: float = quantity(
        0.0, "1", -0.5, 2.0, "hidden effect: k2 of the stiffness k (1 + k2 |x|/X), X the full stroke"
    )
    softening_cubic: float = quantity(
        0.0, "1", -0.3, 2.0, "hidden effect: k3 of the stiffness k (1 + k3 x²/X²), X the full stroke"
    )
    resonance_share: float = quantity(
        0.0, "1", -0.5, 0.5, "hidden effect: share of x that passes through an extra resonance"
    )
    resonance_frequency: float = quantity(1800.0, "Hz", 1.0, 1e6, "natural frequency of the extra resonance")
    resonance_damping: float = quantity(0.01, "1", 1e-4, 1.0, "damping ratio of the extra resonance")

    @property
    def gain(self) -> float:
        """Static displacement over w [m]."""
        return self.dc_gain * self.displacement_scale

    def spring(self, x: float, full: float) -> float:
        """Relative change of stiffness of the first mode at displacement `x`; `full` stroke, both in units of w."""
        return self.softening_quadratic * abs(x / full) + self.softening_cubic * (x / full) ** 2

    def static_mode1(self, w: float, full: float) -> float:
        """First modal coordinate of the settled stage at load `w`, in the unit of `w` and of the `full` stroke.

        Raises
        ------
        ParameterError
            If the softened spring cannot carry the load.
        """
        load = self.share1 * w
        if load == 0.0 or (self.softening_quadratic == 0.0 and self.softening_cubic == 0.0):
            return load

        def balance(x: float) -> float:
            return x * (1.0 + self.spring(x, full)) - load

        grown = load
        while balance(grown) * math.copysign(1.0, load) < 0.0:
            grown *= 1.25
            if abs(grown) > 10.0 * abs(load):
                raise ParameterError(
                    "structure: the softened spring cannot carry the load, expected smaller softening coefficients"
                )
        return float(scipy.optimize.brentq(balance, 0.0, grown, xtol=1e-16))


class Mechanics:
    """State of structure and sensor poles, settled at the normalised output `w`.

    Parameters
    ----------
    structure : Structure
    poles : tuple of float
        Time constants of the sensor electronics [s].
    amplifier_time : float
        Time constant with which w approaches its end within a hold [s]; 0 if it jumps.
    clock : Clock
    full : float
        Full stroke in units of w.
    w : float
        Settled output of the hysteresis and creep.
    """

    def __init__(
        self, structure: Structure, poles: tuple[float, ...], amplifier_time: float, clock: Clock, full: float, w: float
    ) -> None:
        a, load, output = _state_space(structure, poles)
        steps = [_discretise(a, load, dt, amplifier_time) for dt in clock.steps]
        self._transition, self._early, self._late = (np.stack(m) for m in zip(*(s[:3] for s in steps), strict=True))
        force = np.zeros_like(load)
        force[1] = -2 * math.pi * structure.frequency1
        ramps = [_discretise(a, force, dt, math.inf) for dt in clock.steps]
        self._force0, self._force1 = np.stack([r[1] for r in ramps]), np.stack([r[2] for r in ramps])
        self._spring = np.array([structure.softening_quadratic / full, structure.softening_cubic / full**2])
        self._kind, self._before = clock.kind, clock.before
        self._output = output * structure.gain
        first = structure.static_mode1(w, full)
        second = (1 - structure.share1) * w
        self._state = np.full(load.size, first + second)
        self._state[:4] = first, 0.0, second, 0.0
        if structure.resonance_share:
            self._state[5] = 0.0
        self._last = np.array([w])

    def run(self, w: Samples) -> Samples:
        """Displacement at every reading [m], for w at the end of every sub-step."""
        x = np.empty(w.size // self._kind.size)
        _vibrate(
            w, self._kind, self._before, self._transition, self._early, self._late, self._force0, self._force1,
            self._spring, self._output, self._state, self._last, x,
        )  # fmt: skip
        return x


def _state_space(s: Structure, poles: tuple[float, ...]) -> tuple[Samples, Samples, Samples]:
    """Matrix, input column, output row; the states are position and velocity/ω of each mode, then the sensor."""
    modes = [(s.frequency1, s.damping1), (s.frequency2, s.damping2)]
    if s.resonance_share:
        modes.append((s.resonance_frequency, s.resonance_damping))
    n = 2 * len(modes) + len(poles)
    a, load, moved = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for k, (frequency, damping) in enumerate(modes):
        omega = 2 * math.pi * frequency
        a[2 * k, 2 * k + 1] = omega
        a[2 * k + 1, 2 * k : 2 * k + 2] = -omega, -2 * damping * omega
    load[1] = 2 * math.pi * s.frequency1 * s.share1
    load[3] = 2 * math.pi * s.frequency2 * (1 - s.share1)
    moved[[0, 2]] = 1 - s.resonance_share
    if s.resonance_share:
        a[5, [0, 2]] = 2 * math.pi * s.resonance_frequency
        moved[4] = s.resonance_share
    for row, tau in enumerate(poles, 2 * len(modes)):
        a[row] = (moved if row == 2 * len(modes) else np.eye(n)[row - 1]) / tau
        a[row, row] = -1 / tau
    return a, load, np.eye(n)[-1] if poles else moved


def _discretise(a: Samples, column: Samples, dt: float, time_constant: float) -> tuple[Samples, Samples, Samples]:
    """Transition over `dt` and weights of the input at its start and end.

    In between the input approaches its end exponentially with `time_constant`: a jump for 0, a line for infinity.
    """
    n = column.size
    big = np.zeros((n + 2, n + 2))
    big[:n, :n], big[:n, n] = a, column
    if math.isinf(time_constant):
        big[n, n + 1] = 1 / dt
    elif time_constant > 0.0:
        big[:n, n + 1], big[n + 1, n + 1] = column, -1 / time_constant
    moved = expm(big * dt)
    constant, varying = moved[:n, n], moved[:n, n + 1]
    if math.isinf(time_constant):
        return moved[:n, :n], constant - varying, varying
    if time_constant == 0.0:
        return moved[:n, :n], np.zeros(n), constant
    left = math.exp(-dt / time_constant)
    early = (varying - left * constant) / (1 - left)
    return moved[:n, :n], early, constant - early


@kernel
def _vibrate(w, kind, before, transition, early, late, force0, force1, spring, output, state, last, x):
    n = state.size
    count = kind.size
    new = np.empty(n)
    w0 = last[0]
    soft2, soft3 = spring[0], spring[1]
    soft = soft2 != 0.0 or soft3 != 0.0
    for i in range(x.size):
        for j in range(count):
            if j == before:
                reading = 0.0
                for r in range(n):
                    reading += output[r] * state[r]
                x[i] = reading
            w1 = w[i * count + j]
            k = kind[j]
            for r in range(n):
                total = early[k, r] * w0 + late[k, r] * w1
                for c in range(n):
                    total += transition[k, r, c] * state[c]
                new[r] = total
            if soft:
                # a predictor with the force held, then a corrector with the force on a straight line
                f0 = state[0] * (soft2 * abs(state[0]) + soft3 * state[0] ** 2)
                p = new[0] + (force0[k, 0] + force1[k, 0]) * f0
                f1 = p * (soft2 * abs(p) + soft3 * p**2)
                for r in range(n):
                    new[r] += force0[k, r] * f0 + force1[k, r] * f1
            for r in range(n):
                # a decayed oscillation is set to rest, because arithmetic with subnormal numbers is slow
                state[r] = new[r] if abs(new[r]) > 1e-30 else 0.0
            w0 = w1
    last[0] = w0
