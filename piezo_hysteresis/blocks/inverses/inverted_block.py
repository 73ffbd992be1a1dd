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

"""`InvertedBlock`: inverse of one block between the creep and the sensor, from its output to its input.

Every block defines its own in `Block.inverted`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...c_form import CForm

Array = NDArray[np.float64]
State = Any
"""State of a block or of its inverse, used by these only."""


class InvertedBlock(ABC):
    """The inverse of a block.

    Attributes
    ----------
    preview : int
        Number of future samples that must be known.
    is_exact : bool
        Whether run(inverse(y)) equals y up to rounding.
    noise_gain : float
        Largest factor by which rounding errors and noise grow.
    """

    preview: int = 0
    is_exact: bool = True
    noise_gain: float = 1.0

    def start(self, x0: float, state: State, ahead: int) -> State:
        """State from the last input of the block and its state; the first x of `run` is `ahead` samples later."""
        return None

    @abstractmethod
    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        """Inputs x (n,) at `time` (n,) [s] that give the wanted outputs y (n,), and the state after them."""

    def c_form(self, ahead: int) -> CForm | str:
        """`run` as C code, beginning `ahead` samples after the start; ``rest`` takes the input x at rest."""
        return "has no C form of its inverse"
