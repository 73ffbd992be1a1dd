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

"""Choice between play operators and the state of the hysteresis operator, by cross-validation over blocks of samples.

Both fit loops of one amplitude equally well, but they predict different loops for another amplitude. A Bouc-Wen state
has no memory of turning points, so a loop of one amplitude determines little about the next. Play operators with
weights that are not negative (a Prandtl-Ishlinskii operator) keep all smaller loops inside the largest one. Blocks that
were left out of the fit decide; the first block contains the initial loading from rest.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects import MEMORY, Arx
from ...model.model import Model
from ...record import Notice, Record
from ..fit.fit import Fit, fit
from ..fit.normal_equations import Nuisance, residuals
from ..records.conditioning import records_to_fit
from .hysteresis import fit_hysteresis

Array = NDArray[np.float64]

PLAYS = 16
"""Number of play operators; their half widths form a geometric series."""
WIDEST = 0.47
"""Half width of the widest play, as a share of the drive range; a play of half the range would never move."""
BLOCKS = 8
"""Approximate number of blocks into which the records are cut."""
FOLDS = 4
"""Number of folds of the cross-validation."""
FEWEST = 64
"""Smallest number of samples in a block."""
TIE = 1.2
"""Ratio of errors up to which the data do not decide; then plays are used, which stay inside the largest loop."""
LONGEST = 100
"""Largest number of linearisations of the joint fit with plays, which leave their bounds one after another."""


def with_plays(model: Model, records: Sequence[Record]) -> Model | None:
    """The model with plays instead of the state of its operator, whose polynomial stays; None if there is no such form.

    Parameters
    ----------
    model : Model
        Model with a hysteresis.
    records : sequence of Record
        Records whose drive determines the widest play.
    """
    loop = model.hysteresis.memoryless()
    if loop is None:
        return None
    low = min(min(float(r.voltage.min()), r.settled_voltage) for r in records)
    high = max(max(float(r.voltage.max()), r.settled_voltage) for r in records)
    plays = MEMORY(c=(0.0,) * PLAYS, reach=WIDEST * (high - low) / model.voltage_scale)
    return model.with_hysteresis(loop).with_effect(plays)


def linear_numbers(model: Model) -> list[str]:
    """Parameters of the plays and of the polynomial."""
    polynomial = [f"{model.hysteresis.name}.{n}" for n in model.hysteresis.linear_numbers()]
    return polynomial + [f"{MEMORY.name}.c[{j}]" for j in range(PLAYS)]


def choose_memory(
    joint: Fit, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int], loops: Collection[int]
) -> tuple[Fit, tuple[Notice, ...]]:
    """The joint fit, or a fit with plays instead of the state if cross-validation prefers them.

    Parameters
    ----------
    joint : Fit
        Fit of a model with a hysteresis.
    records : sequence of Record
        Records of the experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    fitted, loops : collection of int
        Indices of the records of the joint fit, and of the slow ones that show the hysteresis.

    Returns
    -------
    fit : Fit
        The chosen fit.
    notices : tuple of Notice
        ``memory``, with both errors of the cross-validation.
    """
    plays = with_plays(joint.model, records)
    if plays is None:
        return joint, ()
    blocks, sizes = _blocks(*records_to_fit(records, floors, loops))
    state_error = left_out(blocks, sizes, lambda used: fit_hysteresis(joint.model, blocks, used).model)
    plays_error = left_out(blocks, sizes, lambda used: _fit_plays(plays, blocks, used))
    # with the mean of logarithms, a single bad block does not decide
    of_plays, of_state = (float(np.mean(np.log(np.maximum(e, 1.0)))) for e in (plays_error, state_error))
    message = (
        f"in cross-validation the error is {np.exp(of_plays):.3g} times the noise floor with play operators and "
        f"{np.exp(of_state):.3g} times the noise floor with {joint.model.hysteresis.name} (geometric means)"
    )
    lead = of_plays - of_state
    if lead > np.log(TIE):
        return joint, (Notice("memory", f"{message}; {joint.model.hysteresis.name} is used"),)
    clear = lead < -np.log(TIE)
    because = (
        "the stage remembers its turning points"
        if clear
        else "the data do not decide, and play operators predict other loops better"
    )
    kept, kept_floors = records_to_fit(records, floors, fitted)
    free = [*linear_numbers(plays), *(n for n in joint.names if n.startswith(f"{Arx.name}."))]
    found = fit(plays, kept, free, floors=kept_floors, nuisance=Nuisance(offset=True), max_iterations=LONGEST)
    return found, (Notice("memory", f"{message}; {because}, so {MEMORY.name} is used"),)


def left_out(blocks: Sequence[Record], floors: Sequence[float], fitted_to: Callable[[list[int]], Model]) -> Array:
    """RMS residual over floor of every block with a finite floor, from a fit without it and its neighbours.

    The zero of every block is free, so that drift has no influence.

    Parameters
    ----------
    blocks : sequence of Record
        Blocks in order; those of one record continue each other.
    floors : sequence of float
        Noise floor of every block [m]; infinite if it only determines the state.
    fitted_to : callable
        From indices of blocks to the model fitted to them.
    """
    judged = [i for i, f in enumerate(floors) if np.isfinite(f)]
    errors = {}
    for fold in np.array_split(judged, min(FOLDS, len(judged))):
        left = residuals(fitted_to([i for i in judged if i not in fold]), blocks, Nuisance(offset=True))
        errors.update({i: float(np.sqrt(np.mean(left[i] ** 2))) / floors[i] for i in fold.tolist()})
    return np.array([errors[i] for i in judged])


def _fit_plays(model: Model, blocks: Sequence[Record], used: Collection[int]) -> Model:
    kept, sizes = records_to_fit(blocks, [1.0] * len(blocks), used)
    return fit(model, kept, linear_numbers(model), floors=sizes, nuisance=Nuisance(offset=True)).model


def _blocks(records: Sequence[Record], floors: Sequence[float]) -> tuple[list[Record], list[float]]:
    """Cut the records into about `BLOCKS` blocks of equal length, as far as they are long enough."""
    length = max(FEWEST, sum(r.size for r, f in zip(records, floors, strict=True) if np.isfinite(f)) // BLOCKS)
    blocks, sizes = list[Record](), list[float]()
    for record, floor in zip(records, floors, strict=True):
        count = max(1, round(record.size / length)) if np.isfinite(floor) else 1
        cuts = record.split(*(round(k * record.size / count) for k in range(1, count)))
        blocks += cuts
        sizes += [floor] * count
    return blocks, sizes
