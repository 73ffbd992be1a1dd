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

"""Creep with a power of time. Logarithmic creep is the limit of exponent 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...blocks.block import Block
from ...blocks.relaxation import RelaxationBlock
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .creep import PER_DECADE, REFERENCE_TIME, Creep, settled_mix, slower


class CreepFractional(Creep):
    """Creep whose rate per decade grows or shrinks with time, as in a fractional (power-law) element.

    Parameters
    ----------
    gamma : float
        Creep per decade at 0.1 s after a step, divided by Γ(1 − λ), relative to the response there [1/decade].
    exponent : float
        λ of the power law [1]; 0 is logarithmic creep.
    tau_min, tau_max : float
        Range of the relaxation times [s], as in `Creep`.

    Notes
    -----
    The relaxations are those of `Creep`, with weights proportional to (τ/0.1 s)^λ. Γ is the gamma function: Γ(1 − λ) is
    1 for logarithmic creep, 0.89 for λ = −0.5 and 1.77 for λ = 0.5.

    Examples
    --------
    >>> from .creep import Creep
    >>> u = np.ones(100)
    >>> blocks = [e.block(Discretisation(1e-2, 1e-2)) for e in (Creep(gamma=0.02), CreepFractional(gamma=0.02))]
    >>> log, power = (b.run(u, b.rest(0.0, 0.0))[0] for b in blocks)
    >>> bool(np.array_equal(log, power))
    True
    """

    name = "creep_fractional"
    invertibility = Invertibility.EXACT
    entry = "creep"
    equation = (
        "y = w + γ Σ_j g_j (x_j − w (1 − e^(−0.1/τ_j))),  τ_j ẋ_j + x_j = w,  g_j = ½ (τ_j/0.1)^λ;  "
        "after a step: 1 + γ Γ(1 − λ) ((t/0.1 s)^λ − 1)/(λ ln 10)"
    )
    signature = "The residual is similar to that of logarithmic creep, but grows faster or slower than log t"
    source = "fractional creep as a bank of relaxations; Croft, Shed, Devasia 2001 for λ = 0"
    parameters = (
        replace(Creep.parameters[0], meaning="creep per decade at 0.1 s, divided by Γ(1 − λ)"),
        Parameter(
            "exponent",
            "λ",
            "1",
            0.0,
            -0.5,
            0.5,
            "exponent of the fractional law; 0 is logarithmic",
            "fractional creep",
            scale=0.1,
        ),
        *Creep.parameters[1:],
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        tau = self.tau
        ratio = tau / REFERENCE_TIME
        weights = ratio ** self["exponent"] / PER_DECADE
        growth = np.log(ratio)
        growth[-1] += (slower(self["exponent"]) - 1.0) * np.log(10.0) / PER_DECADE
        by_gamma = settled_mix(tau, weights, self["exponent"])
        by_exponent = self["gamma"] * settled_mix(tau, weights * growth, self["exponent"])
        names = ("creep_fractional.gamma", "creep_fractional.exponent")
        mix = self["gamma"] * by_gamma
        return RelaxationBlock(names, tau, setting.sample_period, mix, np.vstack((by_gamma, by_exponent)))
