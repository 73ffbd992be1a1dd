"""What speaks against an effect that gains: none sees it, it may be off, a hum follows the drive, a limit is none."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from ...effects import AmplifierSaturation, MainsHum
from .candidates import Candidate

PERIODS, RESOLVED, FEWEST = 2.0, 0.2, 4
"""Periods of the mains in a record that tells its amplitude, sample period in periods, and records."""
STEADY = 0.3
"""Least ratio of the quartiles of that amplitude."""
SEEN = 0.5
"""Change in units of the floor."""


def is_seen(candidate: Candidate) -> bool:
    """Whether the effect changes any record by so much as could be seen; hum, free per record, has its own rule.

    A change that is the same in all records is the sensor's zero.
    """
    assert candidate.fit is not None
    training_data, model = candidate.training_data, candidate.fit.model
    with_it, without_it = (
        model.simulate(training_data.records),
        model.without(candidate.name).simulate(training_data.records),
    )
    changes = [first - second for first, second in zip(with_it, without_it, strict=True)]
    counted = [(c, floor) for c, floor in zip(changes, training_data.floors, strict=True) if np.isfinite(floor)]
    means = np.array([c.mean() for c, _ in counted])
    zeros = means if training_data.nuisance.offset else np.full(means.size, means.mean())
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
    measured = sorted((n for n in own if errors[n] > 0.0), key=lambda n: rows(n).off is None)
    off = np.array([(fitted.values[n] - value) / errors[n] for n in measured if (value := rows(n).off) is not None])
    at, scale, k = [fitted.names.index(n) for n in measured], np.array([errors[n] for n in measured]), off.size
    spread = fitted.covariance[np.ix_(at, at)] / np.outer(scale, scale)
    spread = spread[:k, :k] - spread[:k, k:] @ np.linalg.pinv(spread[k:, k:], hermitian=True) @ spread[k:, :k]
    return bool(off @ np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ off < chi2.ppf(0.95, max(1, k)))


def bends_all_along(candidate: Candidate) -> bool:
    """Whether a limit bends over more than the whole drive: that is a curve, and no end of a range."""
    saturates = candidate.name == AmplifierSaturation.name
    return saturates and candidate.effect["corner"] > candidate.training_data.extent.span


def is_steady(candidate: Candidate) -> bool:
    """Whether a hum has about one amplitude in all records: mains does not care what the drive does."""
    assert candidate.fit is not None
    training_data, lines = candidate.training_data, 2 * candidate.training_data.nuisance.harmonics
    frequency = training_data.nuisance.hum_frequency or 0.0
    amplitudes = np.array(
        [
            np.hypot(found[-lines::2], found[1 - lines :: 2])
            for record, floor, found in zip(
                training_data.records, training_data.floors, candidate.fit.nuisances, strict=True
            )
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
