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

"""Loop shape that changes with amplitude: a term of the Bouc-Wen loop."""

from __future__ import annotations

from typing import Self

from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility

START_VALUES = (1.3, 1.7)
"""Start values of the exponent."""


class HysteresisExponent(Term):
    """The loss of the hysteresis state grows with a power of the state.

    Parameters
    ----------
    n : float
        Exponent [1]; 1 is the loop of piezo stages.

    Notes
    -----
    At |h| = h_ref = 0.2 (normalised), a typical size of the state, the loss does not depend on n. Therefore β and γ are
    comparable for all n.
    """

    name = "hysteresis_exponent"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    excitation_need = ExcitationNeed.SEVERAL_AMPLITUDES
    host = "bouc_wen"
    equation = "dh = A dv − (β |dv| h + γ dv |h|)·|h/h_ref|^(n−1),  h_ref = 0.2"
    signature = "The shape of the loop changes with amplitude. Four amplitudes or more are needed to see it"
    source = "paper, Eq. (2), general n; Ismail et al. 2009"
    parameters = (Parameter("n", "n", "1", 1.0, 1.0, 4.0, "exponent of the loss", "paper, Eq. (2)", 1.0, 0.2),)

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Off, and several sizes."""
        return cls(), *(cls(n=n) for n in START_VALUES)
