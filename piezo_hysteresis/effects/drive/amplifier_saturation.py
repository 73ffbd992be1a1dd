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

"""End of the amplifier's output range."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block, MemorylessBlock, State
from ...c_form import CForm
from ...errors import ParameterError
from ...inverse_terms import InverseStart, InverseTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility

UNLIMITED = 1e9
"""Limit that is never reached [V]."""


class AmplifierSaturation(Effect):
    """The amplifier limits the drive voltage, with a smooth bend into each limit.

    Parameters
    ----------
    lower, upper : float
        Limits, as drive voltage before the amplifier [V]; ∓1e9 means no limit.
    corner : float
        Half width c of the bend into each limit [V]; 0 gives hard clipping.

    Notes
    -----
    The slope of the bend is that of a uniform distribution, of standard deviation c/√3. A limit of another form has the
    corner of equal standard deviation: one with the bend s·ln(1 + exp(e/s)), whose slope is logistic, has c = πs.
    """

    name = "amplifier_saturation"
    invertibility = Invertibility.EXACT
    family = "amplifier"
    place = ChainPosition.DRIVE
    equation = "y = x − ramp(x − u_max) + ramp(u_min − x),  ramp(e) = (e + c)²/(4c) if |e| < c, otherwise max(e, 0)"
    signature = "The loop is flattened at one end of the range"
    source = "output limits of high-voltage amplifiers"
    parameters = (
        Parameter("lower", "u_min", "V", -UNLIMITED, -UNLIMITED, 1e3, "lower limit", "data sheets", -UNLIMITED, 1.0),
        Parameter("upper", "u_max", "V", UNLIMITED, -1e3, UNLIMITED, "upper limit", "data sheets", UNLIMITED, 1.0),
        Parameter("corner", "c", "V", 0.1, 0.0, 1e2, "half width of the bend", "data sheets", scale=0.1),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        margins = [share * extent.span for share in (0.01, 0.03, 0.1)]
        corner = 0.01 * extent.span
        above = [cls(upper=extent.voltage_max - margin, corner=corner) for margin in margins]
        return *above, *(cls(lower=extent.voltage_min + margin, corner=corner) for margin in margins)

    def check(self) -> None:
        if self["lower"] >= self["upper"]:
            raise ParameterError(
                f"amplifier_saturation: got lower = {self['lower']:g} V, upper = {self['upper']:g} V, "
                "expected lower < upper"
            )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return AmplifierSaturationBlock(self["lower"], self["upper"], self["corner"])


RAMP = """\
/* Ramp with a bend of half width c. */
static double ramp(double excess, double c)
{
    if (fabs(excess) < c) {
        return (excess + c) * (excess + c) / (4.0 * c);
    }
    return larger(excess, 0.0);
}
"""
"""C function of the bend into each limit."""


class AmplifierSaturationBlock(MemorylessBlock):
    """x − ramp(x − upper) + ramp(lower − x)."""

    names = ("amplifier_saturation.lower", "amplifier_saturation.upper", "amplifier_saturation.corner")

    def __init__(self, lower: float, upper: float, corner: float) -> None:
        self.lower, self.upper, self.corner = lower, upper, corner

    def _ramp(self, excess: Array) -> tuple[Array, Array, Array]:
        """Ramp, and its derivatives with respect to the excess and to the corner."""
        c = self.corner
        if not excess.max(initial=-np.inf) > -c:  # as in most blocks, and always where there is no limit
            return (np.zeros(excess.size),) * 3
        bent = np.abs(excess) < c
        e = np.where(bent, excess, 0.0)
        width = c if c > 0.0 else 1.0
        ramp = np.where(bent, (e + c) ** 2 / (4.0 * width), np.maximum(excess, 0.0))
        slope = np.where(bent, (e + c) / (2.0 * width), (excess > 0.0).astype(np.float64))
        by_corner = np.where(bent, (c - e) * (c + e) / (4.0 * width**2), 0.0)
        return ramp, slope, by_corner

    def value(self, x: Array) -> Array:
        return x - self._ramp(x - self.upper)[0] + self._ramp(self.lower - x)[0]

    def slope(self, x: Array) -> Array:
        return 1.0 - self._ramp(x - self.upper)[1] - self._ramp(self.lower - x)[1]

    def by_parameter(self, x: Array) -> Array:
        _, above, above_corner = self._ramp(x - self.upper)
        _, below, below_corner = self._ramp(self.lower - x)
        return np.vstack((below, above, below_corner - above_corner))

    def c_form(self) -> CForm:
        numbers = {"lower": self.lower, "upper": self.upper, "corner": self.corner}
        return CForm("return x - ramp(x - upper, corner) + ramp(lower - x, corner);", "", numbers, (), (RAMP,))

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms({"lower": self.lower, "upper": self.upper, "corner": self.corner})

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(dict.fromkeys(("slewed", "pole", "held", "pushed"), self.static(x)))
