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

"""Creep that is logarithmic at short and at long times, with different rates."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Block
from ...blocks.relaxation import RelaxationBlock
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .creep import PER_DECADE, Creep, settled_mix


class CreepTwoRates(Creep):
    """Creep with one rate per decade at the shortest times and another at the longest, linear in log t in between.

    Parameters
    ----------
    gamma_fast, gamma_slow : float
        Creep per decade of the relaxations with ``tau_min`` and with ``tau_max``, relative to the response 0.1 s after
        a step [1/decade]; not negative, because creep continues in the direction of the step.
    tau_min, tau_max : float
        Range of the relaxation times [s], as in `Creep`.

    Notes
    -----
    Equal rates give logarithmic creep. The output is linear in both rates. Free time constants would fit noise more
    easily.

    Examples
    --------
    >>> from .creep import Creep
    >>> u = np.ones(100)
    >>> effects = Creep(gamma=0.02), CreepTwoRates(gamma_fast=0.02, gamma_slow=0.02)
    >>> blocks = [e.block(Discretisation(1e-2, 1e-2)) for e in effects]
    >>> one, two = (b.run(u, b.rest(0.0, 0.0))[0] for b in blocks)
    >>> bool(np.allclose(one, two, rtol=0.0, atol=1e-15))
    True
    """

    name = "creep_two_rates"
    entry = "creep"
    invertibility = Invertibility.EXACT
    equation = (
        "y = w + Σ_j g_j (x_j − w (1 − e^(−0.1/τ_j))),  τ_j ẋ_j + x_j = w,  "
        "g_j = ½ (γ_f (1 − s_j) + γ_s s_j),  s_j = log(τ_j/τ_min)/log(τ_max/τ_min)"
    )
    signature = "The residual is similar to that of logarithmic creep, with different rates at short and long times"
    source = "relaxation bank of the logarithmic law; Croft, Shed, Devasia 2001 for equal rates"
    parameters = (
        Parameter("gamma_fast", "γ_f", "1/decade", 0.0, 0.0, 0.2, "creep per decade, fast end", "Croft", 0.0, 0.01),
        Parameter("gamma_slow", "γ_s", "1/decade", 0.0, 0.0, 0.2, "creep per decade, slow end", "Croft", 0.0, 0.01),
        *Creep.parameters[1:],
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        tau = self.tau
        slow = np.log(tau / tau[0]) / np.log(self["tau_max"] / self["tau_min"])
        by = [settled_mix(tau, share / PER_DECADE) for share in (1.0 - slow, slow)]
        names = ("creep_two_rates.gamma_fast", "creep_two_rates.gamma_slow")
        mix = self["gamma_fast"] * by[0] + self["gamma_slow"] * by[1]
        return RelaxationBlock(names, tau, setting.sample_period, mix, np.vstack(by))
