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

"""Errors at rates and amplitudes that were not fitted.

The records are divided into groups of similar rate, and again into groups of similar amplitude. Every group is left out
once: the parameters are fitted to the other groups and judged on this one. A form with many free weights describes only
the rates in its data, and is rejected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import Array
from ...identification.fit.bounded_step import bounded_step, room_of
from ...identification.fit.normal_equations import grams
from ...identification.records.excitation_content import excitation_content
from ...identification.training.adjusted_numbers import adjusted_numbers, directions
from ...identification.training.training_data import TrainingData
from ...model.model import Model

GROUPS = 3
"""Groups of similar rate, and of similar amplitude: slow, middle and fast; small, middle and large."""
ALIKE = 1.05
"""Factor between two rates or amplitudes up to which they belong to the same group."""
STIFFNESS = 1e-6
"""Regularisation as a share of the information of all records: towards the present values, or 0 for a correction."""


@dataclass(frozen=True, eq=False, slots=True)
class HeldOut:
    """RMS error over floor of every used record, with its group left out of the fit.

    Parameters
    ----------
    by_rate : (r,) ndarray
        Errors with the groups of similar rate left out.
    by_amplitude : (k,) ndarray
        Errors with the groups of similar amplitude left out; without the records of the largest amplitudes, because a
        correction is not used outside the range of the others.
    """

    by_rate: Array
    by_amplitude: Array


def groups_of(values: Sequence[float]) -> Array:
    """Number of the group of each value (r,), in ascending order of the values; similar values stay together.

    >>> groups_of([1.0, 100.0, 1.1, 10.0, 9.0, 110.0]).tolist()
    [0, 2, 0, 1, 1, 2]
    >>> groups_of([5.0, 5.0, 5.1]).tolist()
    [0, 0, 0]
    """
    sizes = np.log(np.maximum(np.asarray(values, dtype=float), 1e-300))
    order = np.argsort(sizes, kind="stable")
    found, group = np.zeros(sizes.size, dtype=int), 0
    for place in range(1, sizes.size):
        gap = sizes[order[place]] - sizes[order[place - 1]]
        is_full = place >= (group + 1) * sizes.size / GROUPS
        group += int(is_full and gap > np.log(ALIKE))
        found[order[place]] = group
    return found


def rate_and_amplitude_groups(training_data: TrainingData) -> tuple[Array, Array]:
    """Number of the group of rate, and of the group of amplitude, of every record with a finite floor."""
    counted = zip(training_data.records, training_data.floors, strict=True)
    contents = [excitation_content(r) for r, floor in counted if np.isfinite(floor)]
    return groups_of([c.bandwidth for c in contents]), groups_of([c.span for c in contents])


def held_out(model: Model, training_data: TrainingData, correction: str = "") -> HeldOut:
    """Errors of a fitted model with whole groups left out, computed from inner products.

    Parameters
    ----------
    model : Model
        Model fitted to all records, with the correction if there is one.
    training_data : TrainingData
        Records and floors.
    correction : str
        Identifier of the correction, whose parameters go to zero if the other groups do not determine them.
    """
    counted = [i for i, floor in enumerate(training_data.floors) if np.isfinite(floor)]
    rates, amplitudes = rate_and_amplitude_groups(training_data)
    names = adjusted_numbers(model, training_data)
    columns = directions(model, names)[:-1]
    products = grams(model, training_data.records, names, training_data.free_with(model))
    scaled = [products[i].matrix / (products[i].size * training_data.floors[i] ** 2) for i in counted]
    hessians = np.array([columns.T @ p[:-1, :-1] @ columns for p in scaled])
    slopes = np.array([columns.T @ p[:-1, -1] for p in scaled])
    power = np.array([p[-1, -1] for p in scaled])
    theta = np.array([model.values()[n] for n in names])
    low, high = room_of(model, names, columns)
    own = np.array([n.startswith(f"{correction}.") for n in names], dtype=bool)
    home = columns.T @ np.where(own, -theta, 0.0)  # the step that removes the correction
    diagonal = np.diag(hessians.sum(axis=0))
    stiffness = STIFFNESS * np.where(diagonal > 0.0, diagonal, 1.0)  # some numbers have no influence on these records

    def without_groups(groups: Array) -> Array:
        errors = np.empty(groups.size)
        for group in range(groups.max() + 1):
            kept = groups != group
            hessian = hessians[kept].sum(axis=0)
            # with nearly unstable dynamics, rounding may make it negative
            np.fill_diagonal(hessian, np.maximum(np.diag(hessian), 0.0) + stiffness)
            step = bounded_step(hessian, slopes[kept].sum(axis=0) + stiffness * home, low, high)
            for i in np.flatnonzero(~kept):
                errors[i] = power[i] + step @ hessians[i] @ step - 2.0 * step @ slopes[i]
        return np.asarray(np.sqrt(np.maximum(errors, 0.0)))

    return HeldOut(without_groups(rates), without_groups(amplitudes)[amplitudes < amplitudes.max()])
