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

"""Stiffness that changes with deflection, of one mode in a sum of modes."""

from __future__ import annotations

from typing import ClassVar

from ...blocks.softening.mode_path import OwnPath, Path
from ..invertibility import Invertibility
from .softening import Softening


class SofteningOfOneMode(Softening):
    """The restoring force of the dominant mode is not proportional to its deflection; the other modes stay linear.

    Parameters
    ----------
    k2 : float
        Relative change of stiffness with |x| [1]; negative softens.
    k3 : float
        Relative change of stiffness with x² [1].

    Notes
    -----
    As `Softening`, but the displacement is a sum of modes, and the other modes do not depend on the dominant one.
    """

    name = "softening_of_one_mode"
    invertibility = Invertibility.IMPOSSIBLE
    entry = "softening"
    signature = "The residual is the same as for softening, on a stage with several modes"
    source = "Duffing oscillator as one term of a modal expansion"
    path: ClassVar[type[Path]] = OwnPath
