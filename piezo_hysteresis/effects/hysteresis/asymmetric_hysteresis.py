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

"""Branches of different curvature: a term of the Bouc-Wen loop."""

from __future__ import annotations

from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..invertibility import Invertibility


class AsymmetricHysteresis(Term):
    """The loss of the hysteresis state differs between rising and falling drive, and with the sign of the state.

    Parameters
    ----------
    phi1 : float
        Part of the loss that changes sign with the direction of the drive [1].
    phi2 : float
        Part of the loss that changes sign with the state [1].

    Notes
    -----
    The state is bounded if β − |γ| > |φ1| + |φ2|.
    """

    name = "asymmetric_hysteresis"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "bouc_wen"
    equation = "dh = (dh of bouc_wen) + φ1 dv·h + φ2 |dv|·|h|"
    signature = "The rising and the falling branch have different curvature, at several turning levels"
    source = "Zhu & Rui 2014, asymmetric Bouc-Wen"
    parameters = (
        Parameter(
            "phi1",
            "φ1",
            "1",
            0.0,
            -5.0,
            5.0,
            "loss that changes sign with direction",
            "Zhu & Rui 2014",
            0.0,
            0.5,
            powers=(-1, 0),
        ),
        Parameter(
            "phi2",
            "φ2",
            "1",
            0.0,
            -5.0,
            5.0,
            "loss that changes sign with the state",
            "Zhu & Rui 2014",
            0.0,
            0.5,
            powers=(-1, 0),
        ),
    )
