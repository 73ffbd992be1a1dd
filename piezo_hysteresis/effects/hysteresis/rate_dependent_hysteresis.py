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

"""Loops whose width changes with the speed of the drive: a term of the Bouc-Wen loop."""

from __future__ import annotations

from typing import Self

from ..effect import ChainPosition, Term
from ..extent import Extent
from ..invertibility import Invertibility
from .rate_dependent_hysteresis_lagged import RATE_LAW, RateDependentHysteresisLagged

START_VALUES = (-0.03, 0.03)
"""Start values of k."""
LAG = 1e-4
"""Time constant with which the search for a lag of the speed starts [s]."""


class RateDependentHysteresis(Term):
    """The loop slope A depends on the speed of the normalised drive.

    Parameters
    ----------
    k : float
        Relative change of A per e-fold of speed at v̇ = v0 [1].
    a : float
        Exponent of the rate law [1]; 0 is the logarithm, 1 is proportional to speed.
    jumps : float
        Duration that is assumed for a large change within one sample of a slow record [1]: 0 is the sample period of
        the record, any other value is the sample period of the model.

    Notes
    -----
    v̇ = Δv/T_s is the speed of the drive between two samples, and v0 = 1/s. Speeds below 1e-4/s are replaced by this
    value, so that the law is finite at rest. A change of v by more than 0.05 in one sample of a slow record may be a
    jump or part of a ramp. The record does not show which; `jumps` selects one of them.
    """

    name = "rate_dependent_hysteresis"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "bouc_wen"
    equation = "A_eff = A [1 + k ((|v̇|/v0)^a − 1)/a]"
    signature = (
        "The residual has the sign of h and grows with frequency and amplitude. Plotted against |v̇|, all "
        "records fall on one curve"
    )
    source = "Al Janaideh et al. 2011, rate-dependent Prandtl-Ishlinskii; here on A of paper, Eq. (2)"
    parameters = RATE_LAW

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Off, and sizes of both signs, because the exponent has no influence at k = 0."""
        off = tuple(cls(a=a, jumps=jumps) for jumps in (0.0, 1.0) for a in (0.5, 0.1))
        sizes = ((k, a) for k in START_VALUES for a in (0.3, 0.1, -0.1))
        return off + tuple(cls(k=k, a=a, jumps=jumps) for k, a in sizes for jumps in (0.0, 1.0))

    def refined(self) -> RateDependentHysteresisLagged:
        """The law with a lag of the speed."""
        return RateDependentHysteresisLagged(**self.values, tau=LAG)
