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

"""Loops whose width follows the speed of the drive with a lag: a term of the Bouc-Wen loop."""

from __future__ import annotations

from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..invertibility import Invertibility

RATE_LAW = (
    Parameter("k", "k", "1", 0.0, -0.5, 0.5, "change of loop slope with speed", "Al Janaideh 2011", 0.0, 0.05),
    Parameter(
        "a", "a", "1", 0.5, -0.5, 1.0, "exponent of the rate law; 0 is logarithmic", "Al Janaideh 2011", scale=0.3
    ),
    Parameter(
        "jumps", "f_j", "1", 1.0, 0.0, 1.0, "change within a slow sample: 1 jump, 0 ramp", "sampling", fixed=True
    ),
)
"""Numbers of the rate law, in all forms of the effect."""


class RateDependentHysteresisLagged(Term):
    """The loop slope A depends on the speed of the normalised drive, and follows it with a lag.

    Parameters
    ----------
    k, a, jumps : float
        As in `RateDependentHysteresis`.
    tau : float
        Time constant with which the speed acts [s]; 0 gives `RateDependentHysteresis`.

    Notes
    -----
    q is 0 at rest. The inverse takes |v̇| in its place.
    """

    name = "rate_dependent_hysteresis_lagged"
    entry = "rate_dependent_hysteresis"
    invertibility = Invertibility.APPROXIMATE
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "bouc_wen"
    equation = "A_eff = A [1 + k ((q/v0)^a − 1)/a],  τ dq/dt = |v̇| − q"
    signature = "As for rate_dependent_hysteresis; the loop takes a while to change after a turning point"
    source = "rate law of Al Janaideh et al. 2011, with a first-order lag of its speed"
    parameters = (
        *RATE_LAW,
        Parameter("tau", "τ", "s", 0.0, 0.0, 1.0, "time constant with which the speed acts", "definition", scale=1e-4),
    )
