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

"""Linear dynamics of the stage: ARX with delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.arx import ArxBlock, dc_gain_slopes
from ...blocks.block import Array, Block
from ...blocks.group_delay import GroupDelayBlock
from ...blocks.softening.softened_arx import SlowSoftenedBlock, SoftenedArxBlock
from ...blocks.softening.stiffness import StaticSoftening
from ...errors import ModelError, ParameterError
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility
from .softening import Softening

LONGEST_DELAY = 1e6
"""Longest dead time, and longest group delay near dc [samples]."""


class Arx(Effect):
    """Linear dynamics G(z) = B(z)/A(z)·z^(−d) from w to the position, Eq. (4) and (5).

    Parameters
    ----------
    a : sequence of float
        a1 … a_na of A(z) = 1 + a1 z⁻¹ + …, any length (also none); all poles inside the unit circle.
    b : sequence of float
        b1 … b_nb of B(z) = b1 + b2 z⁻¹ + …, at least one.
    delay : float
        d in samples, 0 or more; a fractional part is realised by third-order Lagrange interpolation.

    Raises
    ------
    ParameterError
        If a pole lies on or outside the unit circle, or `b` is empty.

    Notes
    -----
    The single coefficients of an ARX model of high order are not identifiable, because poles and zeros nearly cancel.
    Compare G(f) instead. In records slower than the model, G is replaced by its dc gain and its group delay at dc,
    Eq. (13).

    Examples
    --------
    >>> round(Arx(a=[-0.9], b=[0.1]).dc_gain, 12)
    1.0
    """

    name = "arx"
    invertibility = Invertibility.EXACT
    family = "dynamics"
    place = ChainPosition.DYNAMICS
    equation = "G(z) = z^(−d) (b1 + b2 z⁻¹ + …)/(1 + a1 z⁻¹ + …)"
    signature = "Resonances and lag are the same at every amplitude"
    source = "paper, Eq. (4), (5)"
    parameters = (
        Parameter("a", "a_i", "1", (), -1e3, 1e3, "denominator coefficients", "paper, Eq. (5)"),
        Parameter("b", "b_i", "1", (1.0,), -1e6, 1e6, "numerator coefficients", "paper, Eq. (5)"),
        Parameter("delay", "d", "samples", 1.0, 0.0, LONGEST_DELAY, "dead time of the stage", "paper, Eq. (4)"),
    )

    def check(self) -> None:
        if self.array("b").size == 0:
            raise ParameterError("arx.b: got no coefficient, expected at least one")
        radius = self.pole_radius
        if radius >= 1.0:
            raise ParameterError(f"arx.a: unstable, got a pole of radius {radius:.6g}, expected all below 1")

    @property
    def poles(self) -> Array:
        """Poles of G in the z plane, shape (na,)."""
        return np.roots(np.append(1.0, self.array("a"))).astype(complex)

    @property
    def pole_radius(self) -> float:
        """Largest magnitude of a pole; 0 without poles."""
        return float(np.abs(self.poles).max(initial=0.0))

    @property
    def dc_gain(self) -> float:
        """G(1), Eq. (11)."""
        return float(self.array("b").sum() / (1.0 + self.array("a").sum()))

    @property
    def group_delay(self) -> float:
        """Group delay near dc [samples], `delay` included, Eq. (11)."""
        a, b = self.array("a"), self.array("b")
        lag_b = np.arange(b.size) @ b / b.sum() if b.sum() else 0.0
        return float(self["delay"] + lag_b - np.arange(1, a.size + 1) @ a / (1.0 + a.sum()))

    def response(self, frequency: Array, sample_period: float) -> NDArray[np.complex128]:
        """Complex frequency response G at `frequency` [Hz], shape (k,), for a sample period [s]."""
        z = np.exp(-2j * np.pi * np.asarray(frequency) * sample_period)
        numerator = np.polyval(self.array("b")[::-1], z)
        denominator = np.polyval(np.concatenate(([1.0], self.array("a")))[::-1], z)
        return np.asarray(numerator / denominator * z ** self["delay"])

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"{self.name}.{n}" for n in self.free_names())
        softening = [t for t in terms if isinstance(t, Softening)]
        if len(softening) > 1:
            raise ModelError(f"arx: got {len(softening)} forms of softening, expected one")
        slow = self._lag(names, setting) if setting.is_slow else None
        if slow is not None and not softening:
            return slow
        fast = ArxBlock(names, self.array("a"), self.array("b"), self["delay"])
        if not softening:
            return fast
        (term,) = softening
        settled, path = StaticSoftening(term.name, term["k2"], term["k3"]), term.path(fast, self["delay"])
        return SoftenedArxBlock(fast, settled, path) if slow is None else SlowSoftenedBlock(slow, fast, settled, path)

    def _lag(self, names: tuple[str, ...], setting: Discretisation) -> GroupDelayBlock:
        """G in records slower than the model."""
        a, b, ratio = self.array("a"), self.array("b"), setting.model_period / setting.sample_period
        at_a, at_b, delay = 1.0 + a.sum(), b.sum(), self.group_delay
        if at_b == 0.0 or not delay <= LONGEST_DELAY:
            raise ParameterError(
                f"arx: got a group delay of {delay if at_b else np.inf:.3g} samples near dc, expected at most "
                f"{LONGEST_DELAY:g}; B(1) or A(1) is almost zero"
            )
        if delay <= 0.0:  # a lead that slow samples cannot show
            return GroupDelayBlock(names, self.dc_gain, 0.0, dc_gain_slopes(a, b), np.zeros(len(names)))
        power_a, power_b = np.arange(1, a.size + 1), np.arange(b.size)
        by_a, by_b = (power_a @ a / at_a - power_a) / at_a, (power_b - power_b @ b / at_b) / at_b
        lag_slopes = ratio * np.concatenate((by_a, by_b, [1.0]))
        return GroupDelayBlock(names, self.dc_gain, ratio * delay, dc_gain_slopes(a, b), lag_slopes)
