"""`diagnose`: floor → where → candidates → add → gap → next experiment; each step a function of its own."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import CATALOGUE, Effect, Offset, PublishedBoucWen
from ..effects.bouc_wen import BoucWen
from ..effects.extent import Extent
from ..errors import IdentificationError, ModelError
from ..identification.carried import select as select_records
from ..identification.fit import Fit, fit
from ..identification.normal_equations import Nuisance, residuals
from ..identification.roles import CARRYING
from ..model import Model
from ..record import Experiment, Notice, Record
from .baseline import start_model
from .candidates import Evidence, free_numbers, score_model
from .diagnosis import Diagnosis, Verdict
from .few_records import diagnose_few
from .gap import Gap, measure_gap
from .localise import localise
from .next_experiment import NextExperiment, propose
from .noise_floor import floors, noise_floors, stroke
from .reach import beyond_reach
from .refit import restart
from .sampling import at_period, common_period, shortened, slowed
from .selection import ADEQUATE, NAMED, Selection, select
from .split import reporting

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

FEWEST = 4
"""Records below which none can be held out and no name is given."""
SEARCHED, FITTED = 6_000, 50_000
"""Samples of a fast record that take part in the search, and in the last fit."""
LAST = 25
"""Linearisations of the last fit."""
NOISY, WORTHWHILE = 1.1, 0.95
"""Cost over that of noise from which it is begun anew, and share of it that may be left for another time."""
FALLS = 0.95
"""Share of the gap on records set aside that may remain after an effect is named."""
MOVES = 30.0
"""Power over noise from which the spectrum of the displacement counts as motion."""
IDLE = ("idle", "hold", *CARRYING)
"""Phases that only bring the stage from one state to another."""


def diagnose(
    experiment: Experiment,
    model: Model | None = None,
    *,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find where simulation and measurement disagree, name the missing effect, add it, and show the gap shrink.

    Parameters
    ----------
    experiment : Experiment
        Records of any kind; the more kinds, and the more realisations of each, the surer the name.
    model : Model, optional
        Where the search begins; identified from the experiment by default.
    effects : collection of Effect classes
        The library to choose from; the whole catalogue by default.
    progress : callable, optional
        Called with a word and the fraction done.

    Returns
    -------
    Diagnosis
        Named, nothing missing, or unknown, with the extended model.

    Raises
    ------
    IdentificationError
        If nothing in the experiment moves.
    ModelError
        If the records are faster than the model.
    """
    tell = progress or (lambda word, fraction: None)
    records = tuple(slowed(r) for r in experiment.records)
    severe = [n for n in experiment.notices if n.severe]
    usable = [i for i, r in enumerate(records) if r.phase not in IDLE and not r.truncated]
    moving = [i for i, r in enumerate(records) if np.ptp(np.append(r.voltage, r.settled_voltage)) > 0.0]
    if not moving:
        raise IdentificationError("diagnose: the drive does not move in any record; expected loops, steps or noise")
    moving = [i for i in moving if i in usable]
    if severe:
        return _undecided(experiment, model, severe)
    if len(moving) < FEWEST:
        return diagnose_few(experiment, model, moving, extent_of, effects, tell)

    tell("baseline", 0.0)
    spared = reporting(records, usable)
    fitted = [i for i in usable if i not in spared]
    noise, least, span = noise_floors(records), floors(records), stroke(records)
    period = model.sample_period if model is not None else common_period(records)
    records = tuple(at_period(r, period) for r in records)
    start = model or start_model(records, fitted)
    start = _exact(start)
    kept, sizes = select_records(shortened(records, SEARCHED), least.tolist(), fitted)
    evidence = Evidence(tuple(kept), np.array(sizes), Nuisance(), extent_of([records[i] for i in usable], start))
    tell("baseline, jointly", 0.25)
    baseline = _joint(start, evidence)
    score = score_model(baseline.model, evidence)
    null = float(np.mean([(noise[i] / least[i]) ** 2 for i in fitted]))

    tell("where", 0.35)
    left = residuals(baseline.model, records, evidence.nuisance)
    where = localise([records[i] for i in usable], [left[i] for i in usable], [least[i] for i in usable])
    selection = select(
        baseline.model,
        evidence.with_peaks(peaks_of([records[i] for i in fitted], [left[i] for i in fitted])),
        score,
        null,
        effects,
        lambda word, part: tell(word, 0.4 + 0.4 * part),
    )
    tell("gap", 0.85)
    named = bool(selection.accepted) and selection.explained(selection.score) >= NAMED
    whole = tuple(select_records(shortened(records, FITTED), least.tolist(), fitted)[0])
    plain = baseline.model if selection.accepted else selection.model  # the search may have found better dynamics
    first = _joint(plain, replace(evidence, records=whole))
    final_evidence = selection.accepted[-1].best.evidence if named else evidence
    final = _finished(selection, replace(final_evidence, records=whole), null) if named else first
    chosen = spared or tuple(fitted)

    def gap_of(last: Fit, nuisance: Nuisance) -> Gap:
        models, nuisances = (first.model, last.model), (evidence.nuisance, nuisance)
        return measure_gap(models, records, chosen, least.tolist(), span, nuisances, bool(spared))

    gap = gap_of(final, final_evidence.nuisance)
    falls = not named or gap.after < FALLS * gap.before
    if named and not falls:
        named, final, gap = False, first, gap_of(first, evidence.nuisance)
    tell("next experiment", 0.95)
    verdict, reason = _verdict(selection, named, falls, gap)
    return Diagnosis(
        verdict=verdict,
        reason=reason,
        model=final.model,
        baseline=first.model,
        selection=selection,
        fit=final,
        where=where,
        gap=gap,
        next_experiment=_next(selection, evidence),
        notices=(*experiment.notices, *beyond_reach([records[i] for i in usable])),
    )


def extent_of(records: list[Record], model: Model) -> Extent:
    """What the records span."""
    return Extent(
        voltage_min=min(float(r.voltage.min()) for r in records),
        voltage_max=max(float(r.voltage.max()) for r in records),
        max_slew=max(float(np.abs(np.diff(r.voltage)).max(initial=0.0)) / r.sample_period for r in records),
        voltage_scale=model.voltage_scale,
        displacement_scale=model.displacement_scale,
        fastest_period=min(r.sample_period for r in records),
        duration=max(r.start_time + r.duration for r in records) - min(r.start_time for r in records),
        longest_record=max(r.duration for r in records),
    )


def peaks_of(records: list[Record], left: list[Array], most: int = 3) -> tuple[float, ...]:
    """Frequencies at which the residual stands out of the displacement most [Hz]: seeds for a resonance.

    Only where the stage moves well above the noise, which is read off the top of the band.
    """
    period = min(r.sample_period for r in records)
    grid = np.geomspace(20.0, 0.45 / period, 200)
    power, reach, lines = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    for record, e in zip(records, left, strict=True):
        if record.sample_period > 1.001 * period or e.size < 256:
            continue
        window = np.hanning(e.size)
        index = np.searchsorted(grid, np.fft.rfftfreq(e.size, record.sample_period))
        inside = (index > 0) & (index < grid.size)
        lines += np.bincount(index[inside], minlength=grid.size)
        for total, signal in ((power, e), (reach, record.displacement)):
            spectrum = np.abs(np.fft.rfft(window * (signal - signal.mean()))) ** 2 / e.size
            total += np.bincount(index[inside], spectrum[inside], grid.size)
    held = lines > 0
    if held.sum() < 8:
        return ()
    frequency, power, reach = grid[held], power[held] / lines[held], reach[held] / lines[held]
    noise = float(np.median(power[frequency > 0.3 / period]))
    ratio = np.where(reach > MOVES * noise, np.maximum(power - noise, 0.0) / reach, 0.0)
    tops = 1 + np.flatnonzero((ratio[1:-1] > ratio[:-2]) & (ratio[1:-1] >= ratio[2:]))
    return tuple(float(frequency[k]) for k in tops[np.argsort(-ratio[tops])][:most])


def _joint(model: Model, evidence: Evidence) -> Fit:
    return fit(
        model,
        evidence.records,
        free_numbers(model, evidence.nuisance),
        floors=evidence.floors.tolist(),
        nuisance=evidence.nuisance,
        max_iterations=LAST,
        tolerance=1e-4,
    )


def _finished(selection: Selection, evidence: Evidence, null: float) -> Fit:
    """The last fit, on all samples, begun anew behind new dynamics while that helps."""
    final = _joint(selection.model, evidence)
    last = selection.accepted[-1].best
    while final.cost > NOISY * null:
        anew = restart(replace(last, effect=final.model[last.name], evidence=evidence, fit=final), LAST).fit
        if anew is None or anew.cost > WORTHWHILE * final.cost:
            break
        final = anew
    return final


def _exact(model: Model) -> Model:
    """The model with the exact loop, which the terms of the catalogue join, and with a sensor zero."""
    if PublishedBoucWen.name in model:
        published = model[PublishedBoucWen.name]
        if published["n"] != 1.0:
            raise ModelError(f"diagnose: got published_bouc_wen.n = {published['n']:g}, expected 1")
        values = {n: v for n, v in published.values.items() if n != "n"}
        model = model.without(PublishedBoucWen.name).with_effect(BoucWen(**values))
    return model if Offset.name in model else model.with_effect(Offset())


def _verdict(selection: Selection, named: bool, falls: bool, gap: Gap) -> tuple[Verdict, str]:
    if named:
        names = " and ".join(s.best.effect.public_name() for s in selection.accepted)
        closed = selection.explained(selection.score)
        rest = (
            "what remains is at the floor"
            if gap.after <= np.sqrt(ADEQUATE) * gap.floor
            else f"a gap of {gap.after / gap.floor:.1f} floors remains unexplained"
        )
        return Verdict.NAMED, f"The model misses {names}: {100 * closed:.0f} % of the gap is explained; {rest}."
    if selection.score.excess <= ADEQUATE and not selection.accepted:
        return Verdict.NOTHING_MISSING, "Nothing is missing beyond noise and the adequacy floor of 0.03 % of range."
    if selection.accepted and not falls:
        names = " and ".join(s.best.effect.public_name() for s in selection.accepted)
        return Verdict.UNKNOWN, f"No name: {names} helps on the records that chose it, not on those set aside."
    closest = selection.steps[0].best if selection.steps else None
    told = ""
    if closest is not None:
        share = 100 * selection.explained(closest.score)
        told = f"; closest is {closest.effect.public_name()}, which explains {share:.0f} %"
    return Verdict.UNKNOWN, f"The model misses an effect that the catalogue does not explain{told}."


def _next(selection: Selection, evidence: Evidence) -> NextExperiment | None:
    """For the first accepted effect that has a rival."""
    for step in selection.accepted:
        mine = step.best
        others = [r for r in step.rivals if r.effect.public_name() != mine.effect.public_name()]
        if others and mine.fit is not None and others[0].fit is not None:
            pair = (mine.effect.public_name(), others[0].effect.public_name())
            return propose(mine.fit.model, others[0].fit.model, pair, evidence)
    return None


def _undecided(experiment: Experiment, model: Model | None, severe: list[Notice]) -> Diagnosis:
    reason = f"No verdict: {severe[0].message}."
    return Diagnosis(Verdict.UNKNOWN, reason, model, model, None, None, (), None, None, experiment.notices)
