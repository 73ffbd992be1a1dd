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

"""The state at rest in which the records begin: that after a ramp from 0 V, or after a loop of the drive.

A stage that was driven before remembers it: at the same voltage its displacement is another one, and its first rise is
as wide as that of a loop. No record may show by which drive. But plays in the state after a loop over the range or over
half of it, or an operator that begins at a state of its own, describe the first rise and the loops after it together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects import HYSTERESIS, MEMORY, Effect
from ...model.model import Model
from ...record import CONDITIONING, Notice, Record
from ..fit.form_uncertainty import ADEQUACY
from ..identified_range import HIGHEST, LOWEST
from .mode import held_by
from .piece_fit import PieceFit, cost_of, linearised
from .pieces import RecordPiece, pieces_of
from .pole_place import LinearPart
from .structure_fit import fit_structure

FIRST, PROMISES = 2, 0.9
"""Number of linearisations in every other state, and largest share of the cost from which the best one is fitted."""
CLEARLY = 0.7
"""Largest share of the cost that another state leaves; otherwise the stage counts as not driven before the records."""


@dataclass(frozen=True, eq=False, slots=True)
class Described:
    """Pieces described by a model with a linear part.

    Parameters
    ----------
    linear : LinearPart
        The linear part.
    fit : PieceFit
        The fit of all numbers beside it.
    pieces : sequence of RecordPiece
        The pieces with the weights of that fit.
    """

    linear: LinearPart
    fit: PieceFit
    pieces: Sequence[RecordPiece]


def in_state_at_rest(
    begun: Model, describe: Callable[[Model], Described], records: Sequence[Record], floors: Sequence[float]
) -> Described:
    """Describe the records by a model in the state at rest that suits them.

    Parameters
    ----------
    begun : Model
        Model of a stage that was not driven before.
    describe : callable
        Fits a model from its start values.
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    """
    found = describe(begun)
    held, models = held_by(found.fit), _driven_before(found.fit.model, records)
    costs = [fit_structure(model, found.pieces, floors, held, FIRST).cost for model in models]
    if not min(costs, default=np.inf) < PROMISES * found.fit.cost:
        return found
    best = int(np.argmin(costs))
    further = replace(found, fit=fit_structure(models[best], found.pieces, floors, held))
    # what was fitted beside the wrong state describes a part of the difference
    anew = describe(_driven_before(begun, records)[best])
    cost = cost_of(anew.fit.model, anew.fit.names, lambda model, names: linearised(model, found.pieces, floors, names))
    other = anew if cost < further.fit.cost else further
    return other if min(cost, further.fit.cost) < CLEARLY * found.fit.cost else found


def begun_as_conditioned(model: Model, records: Sequence[Record]) -> Model:
    """The fitted model in the state at rest in which the conditioning began, if every run of records begins with one.

    Conditioning is not fitted, and no other record depends on the state before it; but its first rise shows this state.

    Parameters
    ----------
    model : Model
        Fitted model.
    records : sequence of Record
        The experiment, in order.
    """
    return begun_as_shown(model, _starts(records)) if _is_hidden(records) else model


def without_hidden_state(model: Model, records: Sequence[Record]) -> Model:
    """The model without the state of its operator at rest, if every run of records begins with a conditioning phase.

    No fitted record depends on it then, and a joint fit would move it anywhere.
    """
    term = model.hysteresis.start_term
    if term is None or term.name not in model or not _is_hidden(records):
        return model
    return model.without(term.name)


def without_hidden_start(effects: Collection[type[Effect]], records: Sequence[Record]) -> Collection[type[Effect]]:
    """The effects without the state of an operator at rest, if every run of records begins with a conditioning phase.

    No fitted record shows this state then. It could only imitate what the model misses in the conditioning.
    """
    return [e for e in effects if e is not HYSTERESIS.start_term] if _is_hidden(records) else effects


def _is_hidden(records: Sequence[Record]) -> bool:
    """Whether every run begins with a conditioning phase, so that no other record depends on the state before it."""
    return all(record.is_named(CONDITIONING) for record in _starts(records))


def _starts(records: Sequence[Record]) -> list[Record]:
    """The first record of every run."""
    return [record for i, record in enumerate(records) if i == 0 or not record.continues]


def begun_as_shown(model: Model, records: Sequence[Record]) -> Model:
    """The fitted model in the state at rest from which it predicts the records best; unchanged if it has one.

    Parameters
    ----------
    model : Model
        Fitted model.
    records : sequence of Record
        Records of the same stage, in order.
    """
    if rest_notices(model) or any(r.truncated for r in _starts(records)) or not any(np.ptp(r.voltage) for r in records):
        return model
    pieces, held = pieces_of(records, range(len(records))), model.values()
    sizes = [ADEQUACY * max(float(np.ptp(r.displacement)) for r in records)] * len(records)
    plain = fit_structure(model, pieces, sizes, held)
    others = [fit_structure(other, pieces, sizes, held) for other in _driven_before(model, records)]
    best = min(others, key=lambda fit: fit.cost, default=plain)
    return best.model if best.cost < CLEARLY * plain.cost else model


def rest_notices(model: Model) -> list[Notice]:
    """``state_at_rest`` if the model begins as a stage that was driven before."""
    term = model.hysteresis.start_term
    if term is not None and term.name in model:
        h0 = ", ".join(f"{value:.3g}" for value in model[term.name].free_values())
        drive = f"driven before: the state of {model.hysteresis.name} at rest is {h0}"
    elif MEMORY.name in model and (turns := model[MEMORY.name].array("turns")).size:
        drive = f"driven before to {' and then to '.join(f'{model.voltage_scale * v:.4g} V' for v in turns)}"
    else:
        return []
    return [Notice("state_at_rest", f"the records begin as those of a stage that was {drive}")]


def lead_of_state(fit: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> dict[str, float]:
    """ln of the factor by which the state of an operator at rest lowers the cost, by the name of the effect."""
    term = fit.model.hysteresis.start_term
    if term is None or term.name not in fit.model:
        return {}
    without = fit_structure(fit.model.without(term.name), pieces, floors, held_by(fit))
    return {term.name: float(np.log(without.cost / fit.cost))}


def _driven_before(model: Model, records: Sequence[Record]) -> list[Model]:
    """The model in every other state at rest at which the records may begin."""
    if MEMORY.name not in model:
        term = model.hysteresis.start_term
        return [model.with_effect(term())] if term is not None else []
    plays, known = model.effect(MEMORY), [float(model.provenance.get(k, np.nan)) for k in (LOWEST, HIGHEST)]
    u = np.concatenate([known, *(np.append(r.voltage, r.settled_voltage) for r in records)]) / model.voltage_scale
    low, high = float(np.nanmin(u)), float(np.nanmax(u))
    near, far = (records[0].settled_voltage / model.voltage_scale + side * plays.radii for side in (-1.0, 1.0))
    states, found = [np.clip(0.0, near, far)], []
    half = 0.5 * (low + high)
    for turns in ((high, low), (low, high), (half, low), (half, high)):
        driven = plays.with_values(turns=turns)
        state = np.clip(driven.before, near, far)
        if not any(np.array_equal(state, other) for other in states):
            states.append(state)
            found.append(model.with_effect(driven))
    return found
