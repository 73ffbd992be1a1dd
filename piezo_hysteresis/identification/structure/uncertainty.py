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

"""Uncertainty of the parameters of the chosen structure, from the residual, the folds and other possible structures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects import MEMORY, Creep, ExtraResonance
from ...errors import IdentificationError
from ..fit.fit import Fit
from ..steps.remaining_lag import amplifier_of
from .mode import SHAPE, SHARE, mode_is_inferred
from .piece_fit import DELAY, Array, PieceFit, free_directions
from .pieces import Kind, RecordPiece
from .pole_place import real_poles
from .prior import INDEPENDENT
from .scores import FAST, Judged

OPEN = 0.4
"""Difference of scores within which another structure is possible; its parameter changes count as uncertainty."""

BETWEEN_SAMPLES = 0.05
"""Uncertainty of a delay that stands for a delay and a pole, or for the form of a ringing drive [samples].

On the stages of `python -m benchmarks.rates` it is 0.02 to 0.07 without a pole. If the whole stage rings, the share of
the mode is 1. A fit with another share replaces the steps of a held drive, which are not linear between samples; its
delay is off by up to 0.12 samples per unit of the share.
"""
NO_POLE = 1e-6
"""Largest pole that counts as none: a fit that would need a negative one ends here."""


def spread_of(full: PieceFit, final: PieceFit, chosen: Judged, judged: Sequence[Judged]) -> Array:
    """Covariance of the parameters from the folds and from other possible structures."""
    numbers = len(full.names)
    own = chosen.without - chosen.step
    count = len(own)
    spread = own.T @ own * ((count - 1.0) / count) if count > 1 else np.zeros((numbers, numbers))
    likely = [j for j in judged if j.score <= chosen.score + OPEN and j is not chosen]
    if likely:
        off = np.array([j.step - chosen.step for j in likely])
        spread = spread + off.T @ off / len(likely)
    place = {n: k for k, n in enumerate(full.names)}
    rows = [place.get(n, place.get(FAST) if n == f"{Creep.name}.gamma" else None) for n in final.names]
    picked = np.zeros((len(final.names),) * 2)
    known = [k for k, r in enumerate(rows) if r is not None]
    there = [r for r in rows if r is not None]
    picked[np.ix_(known, known)] = spread[np.ix_(there, there)]
    return picked


def as_fit(
    found: PieceFit,
    pieces: Sequence[RecordPiece],
    floors: Sequence[float],
    spread: Array,
    open_lag: float = 0.0,
) -> Fit:
    """The fit to pieces as a `Fit`; the variance from the residual is added to `spread`.

    `open_lag` is the difference to the lag of another form that is about as likely [samples].

    The numbers of an inferred mode are left out: each depends on the values that were assumed for the others. What the
    data determine is the lag of delay and mode together, so the covariance of the delay is that of this lag.
    """
    numbers = len(found.names)
    total = found.total
    counted = [p for p in pieces if p.kind is not Kind.CONDITIONING]
    inverse = _inverse(found)
    # the residual is a model error, not noise, so a piece of n samples counts as √n independent samples; what is left
    # after a step beyond the noise is one error, such as the ringing of a mode too fast for the sample period
    meat = np.zeros_like(total[:-1, :-1])
    left = found.squares
    for weight, square, matrix, piece in zip(found.weights, left, found.matrices, counted, strict=True):
        misfit = max(square - 1.0, 0.0) if piece.kind is Kind.STEP else 0.0
        meat += weight**2 * (square / np.sqrt(piece.record.size) + misfit) * matrix[:-1, :-1]
    if DELAY in found.names:
        delay = found.names.index(DELAY)
        spread = spread.copy()
        spread[delay, delay] += BETWEEN_SAMPLES**2 * _open_forms(found) + open_lag**2
    known_to = max(1.0, found.cost) / INDEPENDENT  # independent parts of the misfit
    covariance = (inverse @ meat @ inverse + known_to * inverse)[:numbers, :numbers]
    origins = sorted({p.origin for p in counted})
    runs = sorted({p.run for p in counted})
    run_of = {p.origin: runs.index(p.run) for p in counted}
    rms = []
    for origin in origins:
        mine = [k for k, p in enumerate(counted) if p.origin == origin]
        sizes = np.array([counted[k].record.size for k in mine])
        rms.append(float(np.sqrt(sizes @ left[mine] / sizes.sum())) * floors[origin])
    values = found.model.values()
    if not np.isfinite(covariance).all():
        raise IdentificationError("structure: the inner products of the fit are not finite; check the records")
    covariance = covariance + spread
    stated = list(range(numbers))
    if mode_is_inferred(found.model):
        stated = [k for k, n in enumerate(found.names) if n not in (*SHAPE, SHARE)]
        whole = _whole_lag(found)
        covariance = whole @ covariance @ whole.T
    names = tuple(found.names[k] for k in stated)
    rows = {n: found.model.row(n) for n in names}
    return Fit(
        model=found.model,
        names=names,
        covariance=covariance[np.ix_(stated, stated)],
        cost=found.cost,
        rms=tuple(rms),
        nuisances=tuple(found.zeros[[run_of[o]]] for o in origins),
        at_bounds=tuple(n for n in names if values[n] in (rows[n].lower, rows[n].upper)),
        converged=found.converged,
        iterations=found.iterations,
    )


def _whole_lag(found: PieceFit) -> Array:
    """Matrix (q, q) that replaces a change of the delay by that of the lag of delay and mode together."""
    matrix, place = np.eye(len(found.names)), {n: k for k, n in enumerate(found.names)}
    mode = found.model[ExtraResonance.name]
    by_share = mode["zeta"] / (np.pi * mode["f0"] * found.model.sample_period)
    for name, slope in ((SHARE, by_share), (SHAPE[0], -mode["r"] * by_share / mode["f0"])):
        if {DELAY, name} <= place.keys():
            matrix[place[DELAY], place[name]] = slope
    return matrix


def _open_forms(found: PieceFit) -> float:
    """How often `BETWEEN_SAMPLES` counts, squared: for a pole that is not there, and for a share of the mode but 1.

    The form of an inferred mode is open even beside a pole.
    """
    values = found.model.values()
    lagging = amplifier_of(found.model) is not None or max(real_poles(found.model), default=0.0) > NO_POLE
    has_pole = lagging and not mode_is_inferred(found.model)
    off = values[SHARE] - 1.0 if {SHARE, *SHAPE} <= set(found.names) else 0.0
    return float(not has_pole) + off * off


def _inverse(found: PieceFit) -> Array:
    """Inverse of the normal equations in the free directions.

    Plays without weight stay without it. Any other parameter at a bound is as uncertain as if it had no bound.
    """
    directions = free_directions(found)
    low, high = found.box()
    weights = np.array([n.startswith(f"{MEMORY.name}.c[") for n in found.names], dtype=bool)
    stuck = ((low >= 0.0) | (high <= 0.0)) & np.pad(weights, (0, low.size - weights.size))
    directions = directions[:, ~np.any(directions[stuck] != 0.0, axis=0)]
    hessian = directions.T @ found.total[:-1, :-1] @ directions
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    inverse = np.linalg.pinv(hessian * np.outer(scale, scale), rcond=1e-6, hermitian=True) * np.outer(scale, scale)
    return np.asarray(directions @ inverse @ directions.T)
