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

"""`fit`: joint fit of all free parameters in free run, by damped Gauss-Newton steps with analytic sensitivities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import DivergenceError, IdentificationError, ParameterError
from ...model.model import Model
from ...model.parameter_covariance import ParameterCovariance
from ...record import Record
from .bounded_step import bounds_of, gauge, projected, room_of
from .covariance import covariance
from .normal_equations import Gram, Linearised, Nuisance, grams, linearised_by, residuals
from .stable_step import stable_step
from .time_limit import check_time

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

TRUSTED, STALLED = 1.0, 3
"""Largest damping at which one small decrease of the cost means convergence; number of them in a row that do at any."""
MAX_DAMPING = 1e10
"""Damping at which a fit ends: no step lowers the cost. It has converged, unless even the smallest step diverges."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a joint fit.

    Attributes
    ----------
    model : Model
        Model with the fitted values.
    names : tuple of str
        Names of the free parameters.
    covariance : (q, q) ndarray
        Covariance of the free parameters, from residual variance and colour of every record.
    cost : float
        Mean of (RMS residual / floor)² over the records with a finite floor.
    rms : tuple of float
        RMS residual of every record [m].
    nuisances : tuple of ndarray
        Amplitudes of the disturbances of every record [m].
    at_bounds : tuple of str
        Parameters that stopped at a bound of the parameter table.
    converged : bool
        False if the fit stopped before: at the iteration limit, or because further steps or their derivatives diverge.
    iterations : int
        Number of linearisations.
    linearised : Linearised, optional
        The model linearised at the fitted values; None if the fit did not end with a linearisation.
    """

    model: Model
    names: tuple[str, ...]
    covariance: Array
    cost: float
    rms: tuple[float, ...]
    nuisances: tuple[Array, ...]
    at_bounds: tuple[str, ...]
    converged: bool
    iterations: int
    linearised: Linearised | None = None

    @property
    def stated_model(self) -> Model:
        """`model` with the covariance of its parameters, if there are any and it is finite."""
        if not self.names or not np.isfinite(self.covariance).all():
            return self.model
        return replace(self.model, covariance=ParameterCovariance.of(self.names, self.covariance))

    @property
    def values(self) -> dict[str, float]:
        """Fitted parameters by name."""
        all_values = self.model.values()
        return {n: all_values[n] for n in self.names}

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of every fitted parameter."""
        return dict(zip(self.names, np.sqrt(np.clip(np.diag(self.covariance), 0.0, None)).tolist(), strict=True))

    def interval(self, name: str, sigmas: float = 1.96) -> tuple[float, float]:
        """Interval of a fitted parameter, 95 % by default."""
        value, error = self.values[name], self.standard_errors[name]
        return value - sigmas * error, value + sigmas * error

    def correlation(self, first: str, second: str) -> float:
        """Correlation coefficient of two fitted parameters."""
        i, j = self.names.index(first), self.names.index(second)
        scale = np.sqrt(self.covariance[i, i] * self.covariance[j, j])
        return float(self.covariance[i, j] / scale) if scale > 0.0 else 0.0


def weighted(grams_: Sequence[Gram], floors: Array) -> Array:
    """Mean over the records of Gram/(size·floor²): every record has the same weight.

    A record with an infinite floor only determines the state of the next one, and is not counted.
    """
    total: Array = sum(g.matrix / (g.size * f * f) for g, f in zip(grams_, floors, strict=True))
    return total / np.isfinite(floors).sum()


def fit(
    model: Model,
    records: Sequence[Record],
    free: Sequence[str],
    *,
    floors: Sequence[float] | Array | None = None,
    nuisance: Nuisance | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-6,
    damping: float = 1e-3,
    known: Linearised | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit the parameters `free` of `model` to the free-run displacement of `records`.

    Minimises the mean over the records of (RMS residual / floor)², so that neither a long nor a noisy record dominates.
    The bounds of the parameter table and β ≥ |γ| are kept. G(1) is constant if all of `arx.b` is free.

    Parameters
    ----------
    model : Model
        Model with start values.
    records : sequence of Record
        Records in experiment order.
    free : sequence of str
        Parameters to fit, e.g. ``"bouc_wen.beta"``, ``"arx.a[0]"``.
    floors : sequence of float, optional
        Floor of the residual of every record [m]; default 1 for all, infinite for one that only determines the state.
    nuisance : Nuisance, optional
        Disturbances that are free in every record.
    max_iterations : int
        Largest number of linearisations.
    tolerance : float
        Relative decrease of the cost at convergence.
    damping : float
        Damping of the first step, as a share of the diagonal; a start near the solution needs little.
    known : Linearised, optional
        `model` linearised at its values on these records, if it is known; used if it is by the parameters `free`.
    progress : callable, optional
        Called with a message and the fraction done.

    Raises
    ------
    IdentificationError
        If no parameter is free, or if the start values diverge.
    """
    check_time()
    free = tuple(free)
    if not free or not records:
        raise IdentificationError(f"fit: got {len(free)} numbers and {len(records)} records, expected some of both")
    sizes = np.ones(len(records)) if floors is None else np.asarray(floors, dtype=float)
    lower, upper = bounds_of(model, free)
    values = model.values()
    theta = np.array([values[n] for n in free])
    directions = gauge(model, free)

    try:
        current = linearised_by(model, records, free, nuisance, known).grams
    except DivergenceError as error:
        raise IdentificationError(f"fit: the start values diverge ({error})") from error
    iterations, small, converged, taken = 1, 0, False, True
    total = weighted(current, sizes)
    while iterations < max_iterations and not converged:
        hessian, slope = projected(directions, total)
        diagonal = np.where(np.diag(hessian) > 0.0, np.diag(hessian), 1.0)
        room = room_of(model, free, directions)
        while True:
            step = stable_step(model, free, directions, hessian + np.diag(damping * diagonal), slope, room)
            trial = _bounded(free, np.clip(theta + step, lower, upper))
            # most steps are taken, so a first one is linearised at once
            better, cost, ahead = _try(model, records, free, trial, nuisance, sizes, linearises=taken)
            if taken := cost < total[-1, -1]:
                break
            damping = max(10.0 * damping, 1e-7)
            if damping > MAX_DAMPING:
                break
        if damping > MAX_DAMPING or better is None:
            converged = better is not None
            break
        decrease = 1.0 - cost / total[-1, -1]
        try:
            current = ahead or grams(better, records, free, nuisance)
        except DivergenceError:  # at the limit of stability the output is bounded but its derivatives are not
            break
        model, theta = better, trial
        damping = max(damping / 10.0, 1e-12)
        total = weighted(current, sizes)
        iterations += 1
        small = small + 1 if decrease < tolerance else 0
        converged = small > 0 and (damping < TRUSTED or small >= STALLED)  # one strongly damped step does not show it
        if progress is not None:
            progress("joint fit", iterations / max_iterations)
    return Fit(
        model=model,
        names=free,
        covariance=covariance(model, records, nuisance, current, sizes, directions),
        cost=float(total[-1, -1]),
        rms=tuple(g.rms for g in current),
        nuisances=tuple(g.nuisance for g in current),
        at_bounds=tuple(n for n, v, a, b in zip(free, theta, lower, upper, strict=True) if v in (a, b)),
        converged=converged,
        iterations=iterations,
        linearised=Linearised(free, current, nuisance or Nuisance()),
    )


def _bounded(names: Sequence[str], theta: Array) -> Array:
    """Enforce |γ| ≤ β, because an unbounded Bouc-Wen loop does not describe a piezo (Ismail et al. 2009)."""
    theta = theta.copy()
    for i, name in enumerate(names):
        owner, _, parameter = name.partition(".")
        if parameter == "gamma" and f"{owner}.beta" in names:
            beta = theta[names.index(f"{owner}.beta")]
            theta[i] = np.clip(theta[i], -beta, beta)
    return theta


def _try(
    model: Model,
    records: Sequence[Record],
    free: Sequence[str],
    trial: Array,
    nuisance: Nuisance | None,
    floors: Array,
    linearises: bool,
) -> tuple[Model | None, float, list[Gram]]:
    """The model with the trial values, or None if it diverges, its cost, and its linearisation if that is wanted."""
    try:
        candidate = model.with_values(dict(zip(free, trial.tolist(), strict=True)))
        if linearises:
            with suppress(DivergenceError):  # the output may be bounded although its derivatives are not
                found = grams(candidate, records, free, nuisance)
                return candidate, float(weighted(found, floors)[-1, -1]), found
        left = residuals(candidate, records, nuisance)
        squares = [e @ e / (e.size * f * f) for e, f in zip(left, floors, strict=True) if np.isfinite(f)]
        return candidate, float(np.mean(squares)), []
    except (DivergenceError, ParameterError):
        return None, np.inf, []
