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

"""A stage that settled with a remanent state: a term of the Bouc-Wen loop."""

from __future__ import annotations

from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..invertibility import Invertibility


class InitialState(Term):
    """The hysteresis state at the start of every record that does not continue another record.

    Parameters
    ----------
    h0 : float
        h at the start [normalised, 1]. Motion of the drive cannot produce more than |A|/(β + γ sgn A). A larger value
        is accepted, and decays as soon as the drive moves.
    """

    name = "initial_state"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "bouc_wen"
    equation = "h(0) = h0"
    signature = (
        "The residual is large at the start of a record only and vanishes after the first large swing. "
        "Demagnetise the stage before a record"
    )
    source = "initial condition of paper, Eq. (2)"
    parameters = (
        Parameter(
            "h0", "h0", "1", 0.0, -1.0, 1.0, "remanent hysteresis state", "paper, Eq. (2)", 0.0, 0.05, powers=(0, 1)
        ),
    )
