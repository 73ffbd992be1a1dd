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

"""`stable_step`: a step of a fit that keeps the poles of the dynamics inside the unit circle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects import Arx
from ...errors import ParameterError
from ...model.model import Model
from .bounded_step import bounded_step

Array = NDArray[np.float64]

LARGEST_POLE = 0.99999
"""Largest radius of a pole that is estimated, unless a fit begins with a larger one. Nearer to 1, a zero cancels the
pole almost completely, and what is left of its sensitivities is rounding errors."""
SHORTEST = 1e-3
"""Share of a step of the poles from which it is not shortened further; then the poles are not changed."""


def stable_step(
    model: Model, names: Sequence[str], directions: Array, hessian: Array, slope: Array, room: tuple[Array, Array]
) -> Array:
    """Step (q,) of the parameters to the minimum of ½ xᵀHx − sᵀx; if it is unstable, with a shorter step of the poles.

    The other parameters are not held back: they take their best values for the poles that result.

    Parameters
    ----------
    model : Model
        Model at the present parameters.
    names : sequence of str
        Names of the q parameters.
    directions : (q, p) ndarray
        Directions in which they may change.
    hessian, slope : (p, p) and (p,) ndarray
        H and s along the directions.
    room : tuple of two (p,) ndarray
        Smallest and largest step along every direction.

    Notes
    -----
    Without bounds, the best values of the other parameters depend linearly on the coefficients of the poles. They lie
    on the line from the minimum at unchanged poles to the minimum over all parameters.
    """
    full = directions @ bounded_step(hessian, slope, *room)
    poles = [i for i, n in enumerate(names) if n.startswith(f"{Arx.name}.a[")]
    values = model.values()

    def is_stable(step: Array) -> bool:
        try:
            moved = model.with_values({names[i]: values[names[i]] + float(step[i]) for i in poles})
        except ParameterError:
            return False
        return moved.effect(Arx).pole_radius <= largest

    if not poles:
        return full
    largest = max(LARGEST_POLE, model.effect(Arx).pole_radius)
    if is_stable(full):
        return full
    others = ~directions[poles].any(axis=0)
    low, high = room
    held = directions[:, others] @ bounded_step(
        hessian[np.ix_(others, others)], slope[others], low[others], high[others]
    )
    share = 0.5
    while not is_stable(held + share * (full - held)):
        share = share / 2.0 if share > SHORTEST else 0.0
    return held + share * (full - held)
