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

"""`UnnamedCorrection`: base class of corrections without a physical name."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from ...blocks.block import Array
from ..effect import ChainPosition, Effect
from ..invertibility import Invertibility


@dataclass(frozen=True, eq=False, slots=True)
class CorrectionShape:
    """The shape of a correction as a curve, for figures and files.

    Parameters
    ----------
    x_name, x_unit : str
        Name and unit of the independent quantity.
    x : (n,) ndarray
        Its values in that unit.
    y_name, y_unit : str
        Name and unit of the correction.
    y : (n,) ndarray
        Its values in that unit.
    """

    x_name: str
    x_unit: str
    x: Array
    y_name: str
    y_unit: str
    y: Array


class UnnamedCorrection(Effect):
    """A small, passive correction of the position that has no physical name.

    It is not an effect of the catalogue: a search for effects excludes it, and compensation leaves it out.
    """

    family = "unnamed_correction"
    place = ChainPosition.SENSOR
    invertibility = Invertibility.IMPOSSIBLE
    depends_on: ClassVar[str]
    """Independent quantity of the correction, in words."""

    @abstractmethod
    def shape(self, displacement_scale: float) -> CorrectionShape:
        """The correction as a curve, for a model of this scale [m]."""
