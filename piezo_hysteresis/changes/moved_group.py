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

"""Groups of the change watch as parameters of a model: the group that is recalibrated first, and the changed model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError
from ..model.model import Model
from ..online.change.score import loop_heights
from .signatures import shaped_model

Array = NDArray[np.float64]

FULL = "a full identification is needed"
"""Advice if the parameters of the groups are not sufficient."""


def group_to_fit(groups: Sequence[str]) -> str:
    """The group that is recalibrated first.

    Parameters
    ----------
    groups : sequence of str
        Groups that the watch reports: the best one, and those that the drive cannot distinguish from it.

    Raises
    ------
    IdentificationError
        If there is no group, or if the drive does not determine which group has changed.
    """
    if not groups:
        raise IdentificationError("no group of parameters is known to have changed; nothing to recalibrate")
    if set(groups) == {"slow", "offset"}:
        return "offset"  # if the change continues, the watch reports it again
    if len(groups) > 1:
        raise IdentificationError(
            f"the present drive cannot distinguish {' and '.join(groups)}; drive the stage at another frequency too, "
            f"otherwise {FULL}"
        )
    if groups[0] == "slow":
        raise IdentificationError(f"the model has no parameter for a slow change; {FULL}")
    return groups[0]


def changed_by(model: Model, change: Array) -> Model:
    """A model after a change of its groups: relative gain and loop height, and lag [s].

    Parameters
    ----------
    model : Model
        The model before the change.
    change : (5,) ndarray
        Changes in the order of the groups of the watch; slow and offset are not used, because the model has no
        parameters for them.

    Raises
    ------
    ParameterError
        If a parameter leaves its bounds.
    """
    gain, loop, lag, *_ = change.tolist()
    if loop:
        model = model.with_values({n: (1.0 + loop) * v for n, v in loop_heights(model).items()})
    if lag:
        model = shaped_model(model, "delay", lag)
    return replace(model, displacement_scale=(1.0 + gain) * model.displacement_scale) if gain else model
