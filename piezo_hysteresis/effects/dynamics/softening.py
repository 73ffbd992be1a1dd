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

"""Stiffness that changes with deflection: a term of the dominant mode of the ARX."""

from __future__ import annotations

from typing import ClassVar, Self

from ...blocks.softening.mode_path import Path, WholePath
from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..extent import Extent
from ..invertibility import Invertibility

START_VALUES = (0.01, 0.03, 0.1)
"""Start values of k3. The response is not linear in k3 if a sharp resonance shifts by more than its width."""


class Softening(Term):
    """The restoring force of the dominant mode is not proportional to its deflection.

    Parameters
    ----------
    k2 : float
        Relative change of stiffness with |x| [1]; negative softens.
    k3 : float
        Relative change of stiffness with x² [1].

    Notes
    -----
    x is the coordinate of the mode of the dominant complex pole pair of G, scaled so that x = w for a static linear
    mode. The output of this mode is the input of the rest of G. The delay of G acts outside the feedback of the mode.
    """

    name = "softening"
    invertibility = Invertibility.EXACT
    family = "dynamics"
    place = ChainPosition.DYNAMICS
    host = "arx"
    twin = "sensor_nonlinearity"
    path: ClassVar[type[Path]] = WholePath
    """Form of the block between the mode and the sensor."""
    equation = "m ẍ + c ẋ + k x (1 + k2 |x| + k3 x²) = k w"
    signature = (
        "The resonance frequency changes with amplitude, which large chirps show. On slow drive the effect "
        "equals a cubic sensor nonlinearity"
    )
    source = "Duffing oscillator on the modal coordinate"
    parameters = (
        Parameter(
            "k2", "k2", "1", 0.0, -0.5, 0.5, "change of stiffness with |x|", "Duffing", 0.0, 0.02, powers=(0, -1)
        ),
        Parameter("k3", "k3", "1", 0.0, -1.0, 1.0, "change of stiffness with x²", "Duffing", 0.0, 0.02, powers=(0, -2)),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Switched off, and several sizes of both signs."""
        return (cls(), *(cls(k3=sign * size) for size in START_VALUES for sign in (-1.0, 1.0)))
