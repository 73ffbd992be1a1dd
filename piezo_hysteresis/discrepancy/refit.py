"""Joint refits of candidates: from their start, carried on, behind dynamics found anew, and without the effect again.

Linearised scores rank effects; what an effect is worth only a refit of the whole model tells, and only beside a refit
that had the same chances without it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from ..effects import Arx, MainsHum
from ..errors import DivergenceError, IdentificationError, ModelError, ParameterError
from ..identification.dynamics import identify_arx
from ..identification.fit import Fit, fit
from ..identification.linear_start import (
    FEW_ITERATIONS,
    ITERATIONS,
    dynamics_behind,
    hysteresis_signals,
    with_dynamics,
)
from ..model import Model
from .candidates import Candidate, free_numbers, score_model
from .evidence import Evidence
from .held_out import Score

LINEAR = ("lag", "dynamics")
"""Families that dynamics of an order high enough can hold."""
PERIODS, RESOLVED, FEWEST = 2.0, 0.2, 4
"""Periods of the mains in a record that tells its amplitude, sample period in periods, and records."""
STEADY = 0.3
"""Least ratio of the quartiles of that amplitude."""
SEEN = 0.5
"""Change in units of the floor."""
TOLERANCE = 1e-3
"""Relative decrease of the cost at which a refit has converged."""


@dataclass(frozen=True, eq=False, slots=True)
class Fitted:
    """A fitted model and its score."""

    model: Model
    score: Score


def joint(model: Model, evidence: Evidence, max_iterations: int, tolerance: float = TOLERANCE) -> Fit:
    """All free numbers of a model fitted to the evidence at once.

    Parameters
    ----------
    model : Model
        Where to begin.
    evidence : Evidence
        Records, floors, and what is free in each record.
    max_iterations : int
        Linearisations.
    tolerance : float
        Relative decrease of the cost at which the fit has converged.

    Raises
    ------
    DivergenceError, ParameterError, ModelError, IdentificationError
        As `fit` does.
    """
    return fit(
        model,
        evidence.records,
        free_numbers(model, evidence.nuisance),
        floors=evidence.floors.tolist(),
        nuisance=evidence.nuisance,
        max_iterations=max_iterations,
        tolerance=tolerance,
    )


def refit(model: Model, candidate: Candidate, max_iterations: int) -> Candidate | None:
    """Fit the model with the candidate jointly, from its start; None where that diverges."""
    return _refitted(model.with_effect(candidate.effect), candidate, max_iterations)


def proceed(candidate: Candidate, max_iterations: int) -> Candidate:
    """The refit carried on from where it stopped; itself where it had converged."""
    assert candidate.fit is not None
    if candidate.fit.converged:
        return candidate
    return _refitted(candidate.fit.model, candidate, max_iterations) or candidate


def _refitted(model: Model, candidate: Candidate, max_iterations: int) -> Candidate | None:
    try:
        result = joint(model, candidate.evidence, max_iterations)
        score = score_model(result.model, candidate.evidence)
    except (DivergenceError, ParameterError, ModelError, IdentificationError):
        return None
    return replace(candidate, effect=result.model[candidate.name], score=score, fit=result)


def restart(candidate: Candidate, max_iterations: int) -> Candidate:
    """The refit once more behind dynamics found anew; itself where that is no better.

    The dynamics of the model before were bent by the effect it lacked; from there a joint fit has a long way to go.
    """
    assert candidate.fit is not None
    anew = _behind_anew(candidate.fit.model, candidate.evidence)
    return candidate if anew is None else better(_refitted(anew.model, candidate, max_iterations), candidate)


def from_all_starts(model: Model, candidate: Candidate, max_iterations: int) -> Candidate | None:
    """Refit of the model with the candidate begun at the best start of its effect; None where all diverge.

    Every start is judged behind dynamics found anew: noise that a limit cuts to pieces bends the dynamics so much that
    every size has a valley of its own.
    """
    starts = type(candidate.effect).starts(candidate.evidence.extent)
    found = [_behind_anew(model.with_effect(start), candidate.evidence) for start in starts]
    best = min((f for f in found if f is not None), key=lambda f: f.score.cost, default=None)
    return None if best is None else _refitted(best.model, candidate, max_iterations)


def _behind_anew(model: Model, evidence: Evidence) -> Fitted | None:
    """The model with dynamics found anew; None where the records do not tell them.

    Iterations that describe the broadband records better, by a lack that is still there, may describe the others worse.
    """
    broadband, arx = evidence.broadband(), model["arx"]
    if not broadband or not isinstance(arx, Arx):
        return None
    orders = (arx.array("a").size, arx.array("b").size)
    found = []
    for iterations in (FEW_ITERATIONS, ITERATIONS):
        with suppress(DivergenceError, ParameterError, ModelError, IdentificationError):
            dynamics = dynamics_behind(model, evidence.records, broadband, round(arx["delay"]), orders, iterations)
            anew = with_dynamics(model, dynamics.arx)
            found.append(Fitted(anew, score_model(anew, evidence)))
    return min(found, key=lambda f: f.score.cost, default=None)


def better(anew: Candidate | None, candidate: Candidate) -> Candidate:
    """The refit that fits better; the first may have failed."""
    assert candidate.fit is not None
    return candidate if anew is None or anew.fit is None or anew.fit.cost >= candidate.fit.cost else anew


def without(candidate: Candidate, max_iterations: int) -> Fitted | None:
    """The candidate's model without its effect, all else fitted on; None where that diverges.

    What this has gained over the model before belongs to dynamics and hysteresis, and to no effect.
    """
    assert candidate.fit is not None
    model = candidate.fit.model.without(candidate.name)
    evidence = candidate.evidence.without(candidate.name)
    starts = [model]
    if candidate.effect.family in LINEAR and (absorbed := _absorbed(model, candidate.fit.model, evidence)) is not None:
        starts.append(absorbed)
    found = []
    for start in starts:
        try:
            fitted = joint(start, evidence, max_iterations)
            found.append(Fitted(fitted.model, score_model(fitted.model, evidence)))
        except (DivergenceError, ParameterError, ModelError, IdentificationError):
            continue
    return min(found, key=lambda f: f.score.cost, default=None)


def is_seen(candidate: Candidate) -> bool:
    """Whether the effect changes any record by so much as could be seen; hum, free per record, has its own rule.

    A change that is the same in all records is the sensor's zero.
    """
    assert candidate.fit is not None
    evidence, model = candidate.evidence, candidate.fit.model
    with_it, without_it = model.simulate(evidence.records), model.without(candidate.name).simulate(evidence.records)
    changes = [first - second for first, second in zip(with_it, without_it, strict=True)]
    counted = [(c, floor) for c, floor in zip(changes, evidence.floors, strict=True) if np.isfinite(floor)]
    means = np.array([c.mean() for c, _ in counted])
    zeros = means if evidence.nuisance.offset else np.full(means.size, means.mean())
    return candidate.name == MainsHum.name or any(
        np.sqrt(np.mean((c - zero) ** 2)) > SEEN * floor for (c, floor), zero in zip(counted, zeros, strict=True)
    )


def may_be_off(candidate: Candidate) -> bool:
    """Whether the numbers of the effect could as well all have their off value: Wald's test, the others held.

    A time constant or an exponent has no off value; while it is held, its correlation with a size blurs nothing.
    """
    fitted = candidate.fit
    assert fitted is not None
    errors, rows = fitted.standard_errors, fitted.model.row
    own = [n for n in fitted.names if n.startswith(f"{candidate.name}.")]
    if all(rows(n).off is None for n in own):
        return False
    told = sorted((n for n in own if errors[n] > 0.0), key=lambda n: rows(n).off is None)
    off = np.array([(fitted.values[n] - value) / errors[n] for n in told if (value := rows(n).off) is not None])
    at, scale, k = [fitted.names.index(n) for n in told], np.array([errors[n] for n in told]), off.size
    spread = fitted.covariance[np.ix_(at, at)] / np.outer(scale, scale)
    spread = spread[:k, :k] - spread[:k, k:] @ np.linalg.pinv(spread[k:, k:], hermitian=True) @ spread[k:, :k]
    return bool(off @ np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ off < chi2.ppf(0.95, max(1, k)))


def is_steady(candidate: Candidate) -> bool:
    """Whether a hum has about one amplitude in all records: mains does not care what the drive does."""
    assert candidate.fit is not None
    evidence, lines = candidate.evidence, 2 * candidate.evidence.nuisance.harmonics
    frequency = evidence.nuisance.hum_frequency or 0.0
    amplitudes = np.array(
        [
            np.hypot(found[-lines::2], found[1 - lines :: 2])
            for record, floor, found in zip(evidence.records, evidence.floors, candidate.fit.nuisances, strict=True)
            if np.isfinite(floor)
            and found.size >= lines
            and record.duration * frequency >= PERIODS
            and record.sample_period * frequency <= RESOLVED
        ]
    ).reshape(-1, lines // 2)
    if len(amplitudes) < FEWEST:
        return True
    strongest = amplitudes[:, int(np.argmax(np.median(amplitudes, axis=0)))]
    low, high = np.quantile(strongest, (0.25, 0.75))
    return bool(low > STEADY * high)


def _absorbed(model: Model, extended: Model, evidence: Evidence) -> Model | None:
    """The model with dynamics that imitate those of `extended`, which has one more linear effect; None without records.

    A joint fit may have stopped before its G held a mode that it has room for: what G can hold is no missing effect.
    """
    broadband, arx = evidence.broadband(), model["arx"]
    if not broadband or not isinstance(arx, Arx):
        return None
    inputs = hysteresis_signals(model, evidence.records, broadband)
    outputs = extended.simulate(evidence.records)
    signals = [(w, outputs[i] / model.displacement_scale) for (w, _), i in zip(inputs, broadband, strict=True)]
    try:
        orders = (arx.array("a").size, arx.array("b").size)
        found = identify_arx(signals, round(arx["delay"]), model.sample_period, orders, ITERATIONS)
        return with_dynamics(model, found.arx)
    except (IdentificationError, ParameterError, DivergenceError):
        return None
