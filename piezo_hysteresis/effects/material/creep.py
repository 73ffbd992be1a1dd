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

"""Logarithmic creep of the piezo ceramic."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.relaxation import RelaxationBlock
from ...errors import ParameterError
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility

REFERENCE_TIME = 0.1
"""Time after a step at which creep is defined as zero [s]."""

LASTING = 100.0
"""Ratio of the slowest relaxation time to the time T since the stage was at rest. Within T, all slower relaxations
together are a multiple of the slowest one (`slower`). Without them, 0.002 γ would be missing within T."""

PER_DECADE = 2
"""Relaxations per decade of time; with two, the sum deviates from the logarithm by 0.02 % of the creep per decade."""


class Creep(Effect):
    """After every change of level the displacement continues to grow with the logarithm of time.

    Parameters
    ----------
    gamma : float
        Creep per decade of time, relative to the response 0.1 s after a step [1/decade].
    tau_min, tau_max : float
        Range of the relaxation times [s]: from the fastest sample period to `LASTING` times the longest run.

    Notes
    -----
    For any input, the law is computed as a sum of relaxations, two per decade, Eq. (15). Each is exact for an input
    that is linear between samples. The slowest one also stands for all that are slower (`slower`); relaxations faster
    than ``tau_min`` are left out. A stage at rest does not creep.

    Examples
    --------
    After ten times the time, the response has grown by γ:

    >>> block = Creep(gamma=0.02).block(Discretisation(1e-2, 1e-2))
    >>> y, _ = block.run(np.ones(1001), block.rest(0.0, 0.0))
    >>> round(float(y[1000] - y[100]), 4)
    0.02
    """

    name = "creep"
    invertibility = Invertibility.EXACT
    family = "creep"
    place = ChainPosition.MATERIAL
    excitation_need = ExcitationNeed.HELD_LEVEL
    equation = "y = w + γ Σ_j ½ (x_j − w (1 − e^(−0.1/τ_j))),  τ_j ẋ_j + x_j = w;  after a step: 1 + γ log10(t/0.1 s)"
    signature = (
        "The residual grows with log t after each change of level. On sines the gain falls linearly in log f "
        "while the phase is constant"
    )
    source = "Croft, Shed, Devasia 2001; relaxation bank of the logarithmic law"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gamma", "γ", "1/decade", 0.0, -0.2, 0.2, "creep per decade of time", "Croft 2001", 0.0, 0.01),
        Parameter(
            "tau_min",
            "τ_min",
            "s",
            1e-4,
            1e-7,
            1e3,
            "fastest relaxation: the smallest sample period",
            "bank",
            fixed=True,
        ),
        Parameter(
            "tau_max",
            "τ_max",
            "s",
            1e4,
            1e-3,
            1e8,
            "slowest relaxation: 100 times the longest run",
            "bank",
            fixed=True,
        ),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return (cls(tau_min=extent.fastest_period, tau_max=LASTING * extent.longest_run),)

    def check(self) -> None:
        if not self["tau_max"] >= 10.0 * self["tau_min"]:
            raise ParameterError(
                f"creep: got tau_min = {self['tau_min']:g} s, tau_max = {self['tau_max']:g} s, "
                "expected tau_max of at least 10 tau_min"
            )

    @property
    def tau(self) -> Array:
        """Relaxation times [s], shape (s,)."""
        decades = np.log10(self["tau_max"] / self["tau_min"])
        return self["tau_min"] * 10.0 ** (np.arange(int(PER_DECADE * decades + 1e-9) + 1) / PER_DECADE)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        tau = self.tau
        weights = np.full(tau.size, 1.0 / PER_DECADE)
        by_gamma = settled_mix(tau, weights)
        return RelaxationBlock(
            ("creep.gamma",), tau, setting.sample_period, self["gamma"] * by_gamma, by_gamma[None, :]
        )


def slower(exponent: float = 0.0) -> float:
    """Weight of the slowest relaxation if it stands for itself and all slower ones, relative to its own.

    Parameters
    ----------
    exponent : float
        λ [1] of weights that are proportional to τ^λ; below 1.

    Returns
    -------
    float
        Sum of q^k over k ≥ 0 with q = 10^((λ − 1)/2), for two relaxations per decade: at times far below τ, a
        relaxation is an integral of its input divided by τ.
    """
    return 1.0 / (1.0 - 10.0 ** ((exponent - 1.0) / PER_DECADE))


def settled_mix(tau: Array, weights: Array, exponent: float = 0.0) -> Array:
    """Weights of the direct path and of the relaxations, with which creep is zero 0.1 s after a step.

    Parameters
    ----------
    tau, weights : (s,) ndarray
        Relaxation times [s] and weights of the relaxations.
    exponent : float
        λ [1] of the weights beyond the slowest relaxation, which are proportional to τ^λ.

    Returns
    -------
    (1 + s,) ndarray
    """
    weights = np.append(weights[:-1], weights[-1] * slower(exponent))
    return np.append(weights @ np.expm1(-REFERENCE_TIME / tau), weights)
