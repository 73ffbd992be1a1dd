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

"""Uncertainty of the parameters of a model whose form is not exact.

The standard errors of a fit treat its residual as noise. With a hundred thousand samples they become so small that
errors of the model form are larger: another discretisation of the same law, another integration rule, dynamics of
another order. Such a structured misfit cannot be detected below the adequacy floor, and correlated parameters amplify
it. An interval that ignores it excludes the true value (Brynjarsdóttir and O'Hagan 2014, Sec. 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...effects import Arx
from ...effects.effect import ChainPosition
from ...record import Record
from .bounded_step import gauge
from .covariance import sandwich
from .fit import Fit
from .normal_equations import Nuisance, linearised_by

Array = NDArray[np.float64]

ADEQUACY = 3e-4
"""Adequacy floor: error that counts as perfect, as a share of the range of the experiment."""
LAG = "lag"
"""Family of the effects that delay, beside those that act on the drive."""
PIECES = 16.0
"""Number of independent pieces of the structured misfit in one record: longer records do not make intervals smaller.

Chosen by the coverage of intervals on stages of other form (`python -m benchmarks.coverage`)."""


def with_form_uncertainty(
    fit: Fit,
    records: Sequence[Record],
    nuisance: Nuisance,
    floors: Sequence[float] | Array,
    noise: Sequence[float] | Array,
    span: float,
) -> Fit:
    """The fit with a covariance that includes the uncertainty of the model's form.

    Parameters
    ----------
    fit : Fit
        Fit to the records.
    records : sequence of Record
        Records that were fitted, in order.
    nuisance : Nuisance
        Disturbances that are free in every record; if they are those of the fit, its linearisation is used.
    floors, noise : (r,) array_like
        Floor and noise of every record [m]; the floor is infinite for a record that only determines the state.
    span : float
        Range of the displacement over the experiment [m].

    Notes
    -----
    The misfit of a record is treated as a random function of RMS value δ with `PIECES` independent pieces. The
    right-hand side of the normal equations then has the covariance δ² (n/PIECES) SᵀS, with the sensitivities S of n
    samples. δ is the adequacy floor, or the residual beyond noise if this is larger.

    The signal between two samples is not known. A lag of the model is therefore uncertain by one sample period T with a
    uniform distribution, which adds T²/12 to its variance. So is the time in which an amplifier of largest slope
    follows a fast rise of the drive (`slope_spread`).
    """
    directions = gauge(fit.model, fit.names)
    bread = np.zeros((directions.shape[1],) * 2)
    meat = np.zeros_like(bread)
    products = linearised_by(fit.model, records, fit.names, nuisance, fit.linearised).grams
    for gram, floor, quiet in zip(products, floors, noise, strict=True):
        if np.isfinite(floor):
            weight = 1.0 / (gram.size * floor**2)
            misfit = max((ADEQUACY * span) ** 2, gram.rms**2 - quiet**2)
            inner = directions.T @ gram.matrix[:-1, :-1] @ directions
            bread += weight * inner
            meat += weight**2 * misfit * gram.size / PIECES * inner
    covariance = fit.covariance + sandwich(bread, meat, directions)
    lags = {e.name for e in fit.model.effects if e.family == LAG or e.place is ChainPosition.DRIVE}
    fitted = [r for r, floor in zip(records, floors, strict=True) if np.isfinite(floor)]
    for at, (name, value) in enumerate(fit.values.items()):
        unit = fit.model.row(name).unit
        if name.partition(".")[0] in lags and unit == "s":
            covariance[at, at] += fit.model.sample_period**2 / 12.0
        if unit == "V/s" and np.isfinite(spread := min(slope_spread(r, value) for r in fitted)):
            covariance[at, at] += spread**2
    return replace(fit, covariance=covariance)


def with_alternative(fit: Fit, chosen: Fit, other: Fit) -> Fit:
    """The fit with the difference between two fits in its covariance, of which the data do not exclude the other.

    Parameters
    ----------
    fit : Fit
        Fit of the form of `chosen`.
    chosen, other : Fit
        Fits of both forms to the same records. Coefficients of the dynamics, which are no sizes by themselves, are left
        out.
    """
    ours, theirs = chosen.values, other.values
    compared = [n in ours and n in theirs and not n.startswith(f"{Arx.name}.") for n in fit.names]
    off = np.array([theirs[n] - ours[n] if known else 0.0 for n, known in zip(fit.names, compared, strict=True)])
    return replace(fit, covariance=fit.covariance + np.outer(off, off))


def slope_spread(record: Record, slope: float) -> float:
    """Standard deviation of a largest slope, as the time of a rise is known to within a sample.

    Parameters
    ----------
    record : Record
        Record of one axis.
    slope : float
        Largest slope S [V/s], positive.

    Returns
    -------
    float
        S²T/(h√12) [V/s]. The rise h is the largest change of the drive without a sample that is slower than S or turns
        back. Infinite if the drive is nowhere faster.

    Examples
    --------
    A step of 3 V takes 30 samples.

    >>> step = Record(np.array([0.0, 3.0, 3.0]), np.zeros(3), 1e-3)
    >>> round(slope_spread(step, 100.0), 3)
    0.962
    """
    change = np.diff(record.voltage, prepend=record.settled_voltage)
    fast = np.where(np.abs(change) > slope * record.sample_period, change, 0.0)
    starts = np.flatnonzero(np.diff(np.sign(fast), prepend=0.0))
    rise = np.abs(np.add.reduceat(fast, starts)).max() if starts.size else 0.0
    return float(slope**2 * record.sample_period / (rise * np.sqrt(12.0))) if rise else np.inf
