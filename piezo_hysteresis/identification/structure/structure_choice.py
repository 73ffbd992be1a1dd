"""`choose_structure`: the effects of a model that predict rates, amplitudes and records which were left out.

Free relaxations and free weights fit better and predict disastrously. What is offered is bounded, and predicts: plays
with weights that are not negative or a Bouc-Wen state, cubic and square of the drive, logarithmic creep with one rate
or two, weights that depend on the level, a delay, one pole and one lightly damped mode.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects import (
    Arx,
    Creep,
    CreepTwoRates,
    Effect,
    EvenInputPolynomial,
    ExtraResonance,
    HysteresisMemory,
    LevelDependentMemory,
)
from ...errors import PiezoError
from ...model.model import Model
from ...record import Notice, Record
from ..fit.fit import Fit, Progress
from ..records.conditioning import carried
from .linear_part import fit_linear_part, fit_structure, held_by
from .piece_fit import PieceFit
from .pieces import RecordPiece, pieces_of
from .scores import STRUCTURES, Judged, ModelStructure, judge
from .uncertainty import as_fit, spread_of

PLAYS = 16
"""Plays, geometric in their half widths."""
WIDEST = 0.94
"""Half width of the widest play over the largest drive; on the way from rest a play moves beyond its half width."""
START_CREEP = 0.005
"""Creep per decade at which a fit begins."""
TIE = 0.02
"""Difference of scores (mean ln R²) within which the structure with fewer numbers is taken."""
CREEPS = (Creep.name, CreepTwoRates.name)
"""Forms of creep."""
LEADS = 0.35
"""Lead in score that a Bouc-Wen state needs over plays: they are bounded by what the loops show."""


@dataclass(frozen=True, eq=False, slots=True)
class StructureChoice:
    """Outcome of the choice.

    Parameters
    ----------
    fit : Fit
        Of the structure chosen; its covariance holds what folds left out and rival structures leave open.
    judged : tuple of Judged
        Every structure, best first.
    leads : mapping of str to float
        By how much in score (mean ln R²) every optional effect of the model predicts better what was left out than the
        best structure without it; empty where a Bouc-Wen state was kept.
    notices : tuple of Notice
        ``structure``, ``memory``, ``ringing``.
    """

    fit: Fit
    judged: tuple[Judged, ...]
    leads: Mapping[str, float]
    notices: tuple[Notice, ...]


def choose_structure(
    start: Model, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int], progress: Progress
) -> StructureChoice:
    """Choose the structure of the model and fit it.

    Parameters
    ----------
    start : Model
        With a hysteresis that was fitted to the loops; its scales and its gain are kept.
    records : sequence of Record
        In order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the records to fit.
    progress : callable
        Called with a word and the fraction done.
    """
    kept = carried(records, fitted)
    used, sizes = [records[i] for i in kept], [floors[i] for i in kept]
    pieces = pieces_of(used, [k for k, i in enumerate(kept) if i in fitted])
    progress("structure: lag", 0.1)
    plain, ringing, notices = fit_linear_part(_with_plays(start, used), pieces, sizes)
    progress("structure: effects", 0.4)
    held = held_by(plain)
    full = fit_structure(plain.model.with_effect(LevelDependentMemory()), pieces, sizes, held)
    judged = sorted(judge(full, pieces, STRUCTURES), key=lambda j: j.score)
    best = judged[0]
    chosen = min((j for j in judged if not j.score > best.score + TIE), key=lambda j: (j.structure.size, j.score))
    progress("structure: fit", 0.7)
    final = fit_structure(_reduced(full.model, chosen), pieces, sizes, held)
    progress("structure: rival", 0.85)
    described = "; ".join(f"{_words(j.structure)} {np.exp(0.5 * j.score):.3g}" for j in judged[:3])
    notices.append(
        Notice(
            "structure",
            f"chosen on rates, amplitudes and records left out: {_words(chosen.structure)}; "
            f"error there in floors: {described}",
        )
    )
    rival, lead = _rival(start, final, chosen, pieces, sizes)
    if rival is not None:
        factor = f"by a factor of {np.exp(0.5 * lead):.3g}"
        notices.append(Notice("memory", f"a Bouc-Wen state predicts what was left out better {factor}: it is kept"))
        nothing = np.zeros((len(rival.names),) * 2)
        return StructureChoice(as_fit(rival, pieces, sizes, nothing), tuple(judged), {}, tuple(notices))
    notices.append(Notice("memory", f"{HysteresisMemory.name} is taken: turning points are remembered"))
    spread = spread_of(full, final, chosen, judged)
    leads = {HysteresisMemory.name: -lead, ExtraResonance.name: ringing, **_leads(chosen, judged)}
    return StructureChoice(as_fit(final, pieces, sizes, spread), tuple(judged), leads, tuple(notices))


def _leads(chosen: Judged, judged: Sequence[Judged]) -> dict[str, float]:
    """Lead of the chosen structure over the best structure without one of its effects."""
    found = {}
    for name in chosen.structure.effects:
        family = CREEPS if name in CREEPS else (name,)
        rest = [j.score for j in judged if not set(family) & set(j.structure.effects)]
        found[name] = min(rest) - chosen.score
    return found


def _with_plays(start: Model, records: Sequence[Record]) -> Model:
    """All effects but those that depend on the level, at values from which a fit goes downhill."""
    period = start.sample_period
    farthest = max(float(np.abs(np.append(r.voltage, r.settled_voltage)).max()) for r in records)
    low = min(float(np.append(r.voltage, r.settled_voltage).min()) for r in records)
    high = max(float(np.append(r.voltage, r.settled_voltage).max()) for r in records)
    reach = WIDEST * max(farthest, 0.5 * (high - low)) / start.voltage_scale
    longest = max(r.duration for r in records)
    effects: tuple[Effect, ...] = (
        start.hysteresis.memoryless() or start.hysteresis,
        HysteresisMemory(c=(0.02,) * PLAYS, reach=reach, virgin=1.0),
        EvenInputPolynomial(),
        CreepTwoRates(
            gamma_fast=START_CREEP, gamma_slow=START_CREEP, tau_min=period, tau_max=max(10.0 * longest, 20.0 * period)
        ),
        Arx(a=(), b=(1.0,), delay=1.0),
    )
    return Model(effects, period, start.voltage_scale, start.displacement_scale)


def _reduced(model: Model, chosen: Judged) -> Model:
    """The full model without the effects that were not chosen."""
    structure = chosen.structure
    if not structure.square:
        model = model.without(EvenInputPolynomial.name)
    if not structure.level:
        model = model.without(LevelDependentMemory.name)
    if structure.creep_rates < 2:
        creep = model[CreepTwoRates.name]
        model = model.without(CreepTwoRates.name)
        if structure.creep_rates == 1:
            rate = 0.5 * (creep["gamma_fast"] + creep["gamma_slow"])
            model = model.with_effect(Creep(gamma=rate, tau_min=creep["tau_min"], tau_max=creep["tau_max"]))
    return model


def _rival(
    start: Model, final: PieceFit, chosen: Judged, pieces: Sequence[RecordPiece], floors: Sequence[float]
) -> tuple[PieceFit | None, float]:
    """The Bouc-Wen state in the place of the plays where it leads clearly, and by how much in score."""
    model = final.model.without(LevelDependentMemory.name).without(HysteresisMemory.name)
    model = model.with_hysteresis(start.hysteresis)
    same = ModelStructure(True, 2, True)
    try:
        rival = fit_structure(model, pieces, floors, held_by(final))
        lead = next(judge(final, pieces, (same,))).score - next(judge(rival, pieces, (same,))).score
    except PiezoError:
        return None, 0.0
    return (rival, lead) if lead > LEADS else (None, lead)


def _words(structure: ModelStructure) -> str:
    return " + ".join(("plays + cubic", *structure.effects))
