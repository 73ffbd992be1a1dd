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

"""`choose_structure`: chooses the effects of a model by how well they predict rates, amplitudes and records left out.

Relaxations and weights without bounds fit the data better, but their predictions are much worse. Therefore only
bounded effects are offered: play operators with weights that are not negative, or the state of a hysteresis operator;
the cube and the square of the drive; logarithmic creep with one rate or two; weights that depend on the level; a delay,
one pole and one lightly damped mode, and ARX of higher order where a step shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ...effects import (
    MEMORY,
    Arx,
    Creep,
    CreepTwoRates,
    Effect,
    EvenInputPolynomial,
)
from ...effects.extent import Extent
from ...errors import PiezoError
from ...model.model import Model
from ...record import Notice, Record
from ..fit.fit import Fit, Progress
from ..records.conditioning import with_conditioning
from .linear_part import fit_linear_part
from .mode import held_by
from .piece_fit import PieceFit
from .pieces import Kind, RecordPiece, pieces_of
from .pole_place import FitLinearPart
from .scores import STRUCTURES, TIE, Judged, ModelStructure, Ranking
from .state_at_rest import Described, in_state_at_rest, lead_of_state, rest_notices
from .step_weights import discounted_steps
from .structure_fit import fit_structure
from .uncertainty import as_fit, spread_of

PLAYS = 16
"""Number of play operators; their half widths form a geometric series."""
WIDEST = 0.94
"""Half width of the widest play, as a share of the largest drive; a play at rest moves once the drive exceeds it."""
START_CREEP = 0.005
"""Creep per decade of time at which a fit starts."""
DISCOUNTS = 2
"""Number of times that the weights of steps are adapted to their misfit; the first fit takes part of it up."""
SIMPLER = f", because it is the simplest within {100 * np.expm1(0.5 * TIE):.0f} % of the best one"
"""Addition to the message if the chosen structure is not the best one."""
CREEPS = (Creep.name, CreepTwoRates.name)
"""Forms of creep."""
LEADS = 0.35
"""Difference of scores (mean ln R²) from which the state of the operator is preferred to plays.

Plays are preferred below it, because they stay inside the largest measured loop.
"""


@dataclass(frozen=True, eq=False, slots=True)
class StructureChoice:
    """Result of the choice.

    Parameters
    ----------
    fit : Fit
        Fit of the chosen structure; its covariance includes the spread over the folds and over rival structures.
    judged : tuple of Judged
        Every structure with the chosen kind of hysteresis, best first.
    leads : mapping of str to float
        For every optional effect, the score (mean ln R²) of the best structure without it minus the score of the chosen
        one, if there are structures without it; both have the chosen kind of hysteresis.
    notices : tuple of Notice
        ``structure``, ``memory``, ``state_at_rest``, ``ringing``, ``step_edge``, ``amplifier``, ``step_time``.
    """

    fit: Fit
    judged: tuple[Judged, ...]
    leads: Mapping[str, float]
    notices: tuple[Notice, ...]


def choose_structure(
    start: Model,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
    progress: Progress,
    fit_linear: FitLinearPart = fit_linear_part,
    behind_operator: FitLinearPart | None = None,
) -> StructureChoice:
    """Choose the structure of the model, and fit it.

    Parameters
    ----------
    start : Model
        Model with a hysteresis fitted to the loops, in its natural gauge (`Gauge`), which is kept.
    records : sequence of Record
        Records in the order of the experiment.
    floors : sequence of float
        Noise floor of every record [m].
    fitted : collection of int
        Indices of the records to fit.
    progress : callable
        Called with the name of the step and the fraction done.
    fit_linear : callable
        Fits the linear part; by default the one that loops and steps determine.
    behind_operator : callable, optional
        Fits the linear part behind the operator; by default, it begins with that behind plays.
    """
    kept = with_conditioning(records, fitted)
    used, sizes = [records[i] for i in kept], [floors[i] for i in kept]
    pieces = pieces_of(used, [k for k, i in enumerate(kept) if i in fitted])
    progress("structure: lag", 0.1)

    def with_plays(model: Model) -> Described:
        linear, described = fit_linear(model, pieces, sizes), pieces
        full = linear.fit
        for _ in range(DISCOUNTS):
            described = discounted_steps(described, full)
            if all(p.share == 1.0 for p in described):
                break
            full = fit_structure(full.model, described, sizes, held_by(full))
        return Described(linear, full, described)

    begun = _with_plays(start, used)
    plays = in_state_at_rest(begun, with_plays, used, sizes)
    linear, full, weighted, held = plays.linear, plays.fit, plays.pieces, held_by(plays.linear.fit)
    progress("structure: rival", 0.6)

    def with_operator(model: Model) -> Described:
        if behind_operator is None:
            return Described(linear, fit_structure(model, weighted, sizes, held), weighted)
        behind = behind_operator(model, weighted, sizes)
        return Described(behind, behind.fit, weighted)

    def fit_operator() -> PieceFit:
        operator = _with_operator(begun if behind_operator else full.model, start)
        return in_state_at_rest(operator, with_operator, used, sizes).fit

    ranking, lead = _with_plays_or_operator(full, fit_operator, weighted)
    progress("structure: fit", 0.8)
    chosen, judged = ranking.chosen, ranking.judged
    final = fit_structure(_reduced(ranking.full.model, chosen), weighted, sizes, held)
    message = (
        f"by prediction of rates, amplitudes and records left out, {ranking.words(chosen)} was chosen"
        f"{'' if chosen is judged[0] else SIMPLER}; prediction errors in units of the noise floor: {ranking.described}"
    )
    notices = [*linear.notices(final), *rest_notices(final.model), Notice("structure", message)]
    leads = {**linear.leads, **lead_of_state(final, weighted, sizes), **_leads(chosen, judged)}
    if MEMORY.name not in final.model:
        message = f"predicts data left out better than the plays by a factor of {np.exp(0.5 * lead):.3g}"
        message = f"{start.hysteresis.name} {message}, so it takes their place"
    else:
        leads[MEMORY.name] = -lead
        message = f"{MEMORY.name} is used: the stage remembers its turning points"
        if not final.model[MEMORY.name].array("c").any():
            message = "no hysteresis was found: the weights of all plays are 0"
    notices.append(Notice("memory", message))
    fit = as_fit(final, weighted, sizes, spread_of(ranking.full, final, chosen, judged), linear.open_lag)
    return StructureChoice(fit, judged, leads, tuple(notices))


def _leads(chosen: Judged, judged: Sequence[Judged]) -> dict[str, float]:
    """Score of the best structure without an effect, minus the score of the chosen one."""
    found = {}
    for name in chosen.structure.effects:
        family = CREEPS if name in CREEPS else (name,)
        rest = [j.score for j in judged if not set(family) & set(j.structure.effects)]
        if rest:
            found[name] = min(rest) - chosen.score
    return found


def _offered(pieces: Sequence[RecordPiece]) -> list[ModelStructure]:
    """The structures to choose from; a drive of one rate does not tell creep from a longer lag or a wider loop.

    Every piezo ceramic creeps, and what takes the place of creep at one rate predicts others badly.
    """
    several_rates = len({p.rate for p in pieces if p.kind is Kind.LOOP}) > 1
    return [s for s in STRUCTURES if s.creep_rates > 0 or several_rates]


def _with_plays(start: Model, records: Sequence[Record]) -> Model:
    """The model with all effects that are offered, at start values."""
    period = start.sample_period
    farthest = max(float(np.abs(np.append(r.voltage, r.settled_voltage)).max()) for r in records)
    low = min(float(np.append(r.voltage, r.settled_voltage).min()) for r in records)
    high = max(float(np.append(r.voltage, r.settled_voltage).max()) for r in records)
    reach = WIDEST * max(farthest, 0.5 * (high - low)) / start.voltage_scale
    extent = Extent.of(records, start.voltage_scale, start.displacement_scale)
    (creep,), (level,) = CreepTwoRates.starts(extent), MEMORY.level_term.starts(extent)
    effects: tuple[Effect, ...] = (
        start.hysteresis.memoryless() or start.hysteresis,
        MEMORY(c=(0.02,) * PLAYS, reach=reach, virgin=1.0),
        level,
        EvenInputPolynomial(),
        creep.with_values(gamma_fast=START_CREEP, gamma_slow=START_CREEP),
        Arx(a=(), b=(start.effect(Arx).dc_gain,), delay=1.0),
    )
    return Model(effects, period, start.voltage_scale, start.displacement_scale)


def _reduced(model: Model, chosen: Judged) -> Model:
    """The full model without the effects that were not chosen."""
    structure = chosen.structure
    if not structure.square:
        model = model.without(EvenInputPolynomial.name)
    if not structure.level:
        model = model.without(MEMORY.level_term.name)
    if structure.creep_rates < 2:
        creep = model[CreepTwoRates.name]
        model = model.without(CreepTwoRates.name)
        if structure.creep_rates == 1:
            rate = 0.5 * (creep["gamma_fast"] + creep["gamma_slow"])
            model = model.with_effect(Creep(gamma=rate, tau_min=creep["tau_min"], tau_max=creep["tau_max"]))
    return model


def _with_operator(model: Model, start: Model) -> Model:
    """The model with the operator of `start` instead of plays."""
    return model.without(MEMORY.level_term.name).without(MEMORY.name).with_hysteresis(start.hysteresis)


def _with_plays_or_operator(
    full: PieceFit, fit_operator: Callable[[], PieceFit], pieces: Sequence[RecordPiece]
) -> tuple[Ranking, float]:
    """The structures with plays, or with the operator if it predicts clearly better, and the difference of the scores.

    The effects beside the operator are chosen anew: those beside plays may describe what plays leave of its loops.
    """
    offered = _offered(pieces)
    plays = Ranking.of(full, pieces, offered)
    with suppress(PiezoError):
        operator = Ranking.of(fit_operator(), pieces, [s for s in offered if not s.level])
        lead = plays.chosen.score - operator.chosen.score
        return (operator if lead > LEADS else plays), lead
    return plays, 0.0
