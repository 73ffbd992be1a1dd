"""Dynamics as a sum of modes, fitted by output error: what poles that crowd near z = 1 need.

At 50 kHz the poles of a mode at 500 Hz lie within 0.06 of z = 1. Coefficients of A(z) then depend on one another to
the last digits, and noise at high frequencies outweighs the modes. A sum of sections of second order has neither
trouble; where it begins, dynamics found at a lower rate tell, with their poles carried back by z → z^(1/q).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.signal import decimate, lfilter

from ..effects import Arx
from ..errors import IdentificationError, ParameterError
from .dynamics import LARGEST_POLE, Dynamics, free_run_error, identify_arx
from .regressors import Signals

Array = NDArray[np.float64]

FACTORS = (4, 16)
"""Ratios of the full rate to the lower ones."""
SHORTEST = 50
"""Samples of a record at the lower rate at least."""
SAMPLES = 60_000
"""Samples that are fitted at most."""
LINEARISATIONS = 15
CONVERGED = 1e-3
"""Relative decrease of the squared error at which no further one is made."""


def identify_modes(signals: Signals, delay: int, sample_period: float, order: int, iterations: int) -> Dynamics:
    """The best sum of modes, begun at several lower rates.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record.
    delay : int
        d, samples.
    sample_period : float
        Sample period [s].
    order : int
        na = nb, even.
    iterations : int
        Steiglitz-McBride iterations at most at a lower rate.

    Raises
    ------
    IdentificationError
        If no record is long enough, or poles crowd so much that rounded coefficients do not hold them.
    """
    few = _shortened(signals)
    found: list[tuple[float, Array]] = []
    for factor in FACTORS:
        with suppress(IdentificationError):
            sections = _found_at(factor, signals, delay, sample_period, order, iterations)
            found.append((_linearised(sections, few, delay)[0], sections))
    if not found:
        raise IdentificationError(f"modes: got no record that tells any, expected {SHORTEST * max(FACTORS)} samples")
    _, sections = min(found, key=lambda f: f[0])
    a, b = _polynomials(*_fitted(sections, few, delay))
    try:
        if not 1.0 + a.sum() > 0.0:
            raise ParameterError("modes: got no dc gain")
        arx = Arx(a=tuple(a.tolist()), b=tuple(b.tolist()), delay=delay)
    except ParameterError as problem:
        raise IdentificationError(f"modes: {problem}; the poles crowd too much for coefficients") from None
    return Dynamics(arx, sample_period, free_run_error=free_run_error(Dynamics(arx, sample_period), signals))


def _shortened(signals: Signals) -> Signals:
    """The beginnings of the records, each settled."""
    share = min(1.0, SAMPLES / sum(y.size for _, y in signals))
    return [(u[: int(share * u.size)], y[: int(share * y.size)]) for u, y in signals]


def _found_at(factor: int, signals: Signals, delay: int, sample_period: float, order: int, iterations: int) -> Array:
    """Denominators (order/2, 2) of sections, from dynamics found at a lower rate."""
    slow = [
        (decimate(u - u[0], factor, ftype="fir"), decimate(y - y[0], factor, ftype="fir"))
        for u, y in signals
        if y.size >= SHORTEST * factor
    ]
    if not slow:
        raise IdentificationError(f"modes: got no record of {SHORTEST * factor} samples")
    found = identify_arx(slow, max(1, round(delay / factor)), factor * sample_period, (order, order), iterations)
    poles = np.roots(np.concatenate(([1.0], found.arx.array("a")))).astype(complex)
    slowest = np.exp(-1.0 / max(y.size for _, y in slow))
    modes = poles[(poles.imag > 0.0) & (np.abs(poles) > 0.0)] ** (1.0 / factor)
    real = poles[(poles.imag == 0.0) & (poles.real > 0.0) & (poles.real < slowest)].real ** (1.0 / factor)
    sections = [(-2.0 * z.real, abs(z) ** 2) for z in modes]
    real = np.concatenate((np.sort(real)[::-1], np.zeros(order)))
    pairs = range(order // 2 - len(sections))
    sections += [(-real[2 * k] - real[2 * k + 1], real[2 * k] * real[2 * k + 1]) for k in pairs]
    return np.array(sections)


def _linearised(sections: Array, signals: Signals, delay: int) -> tuple[float, Array, Array, Array]:
    """Mean square left by the best numerators, these (k, 2), and inner products of ∂y/∂(a1, a2) and the residual."""
    columns, outputs = [], []
    for u, y in signals:
        shifted = np.concatenate((np.zeros(delay), u[: u.size - delay] - u[0]))
        shaped = [lfilter([1.0], np.concatenate(([1.0], a)), shifted) for a in sections]
        taps = np.array([_delayed(s, k) for s in shaped for k in (0, 1)])
        columns.append(taps - taps.mean(axis=1, keepdims=True))
        outputs.append(y - y.mean())
    basis, output = np.concatenate(columns, axis=1), np.concatenate(outputs)
    scale = np.linalg.norm(basis, axis=1)
    scale[scale == 0.0] = 1.0
    basis /= scale[:, None]
    inner = basis @ basis.T
    taps = np.linalg.lstsq(inner, basis @ output, rcond=1e-13)[0]
    residual = output - taps @ basis
    return float(residual @ residual / output.size), (taps / scale).reshape(-1, 2), residual, basis


def _delayed(x: Array, samples: int) -> Array:
    return np.concatenate((np.zeros(samples), x[: x.size - samples]))


def _slopes(sections: Array, numerators: Array, signals: Signals, delay: int) -> Array:
    """∂y/∂(a1, a2) of every section, shape (2k, n), freed of the means of the records."""
    columns = []
    for u, _ in signals:
        shifted = np.concatenate((np.zeros(delay), u[: u.size - delay] - u[0]))
        rows = []
        for a, b in zip(sections, numerators, strict=True):
            feedback = np.concatenate(([1.0], a))
            twice = -lfilter([1.0], feedback, lfilter(b, feedback, shifted))
            rows += [_delayed(twice, 1), _delayed(twice, 2)]
        slopes = np.array(rows)
        columns.append(slopes - slopes.mean(axis=1, keepdims=True))
    return np.concatenate(columns, axis=1)


def _fitted(sections: Array, signals: Signals, delay: int) -> tuple[Array, Array]:
    """Denominators and numerators at the least squares of the output error: Levenberg-Marquardt on the denominators."""
    error, numerators, residual, basis = _linearised(sections, signals, delay)
    damping = 1e-3
    for _ in range(LINEARISATIONS):
        slopes = _slopes(sections, numerators, signals, delay)
        # variable projection: numerators follow
        slopes -= (slopes @ basis.T) @ np.linalg.pinv(basis @ basis.T, rcond=1e-13, hermitian=True) @ basis
        size = np.linalg.norm(slopes, axis=1)
        size[size == 0.0] = 1.0
        slopes /= size[:, None]
        gained = False
        for _ in range(6):
            inner = slopes @ slopes.T
            step = np.linalg.lstsq(inner + damping * np.eye(size.size), slopes @ residual, rcond=1e-13)[0] / size
            tried = sections + step.reshape(-1, 2)
            if _radius(tried) < LARGEST_POLE:
                new = _linearised(tried, signals, delay)
                if new[0] < error:
                    gained, before = True, error
                    sections, (error, numerators, residual, basis) = tried, new
                    damping *= 0.1
                    break
            damping *= 10.0
        if not gained or before - error < CONVERGED * before:
            break
    return sections, numerators


def _radius(sections: Array) -> float:
    return max(float(np.abs(np.roots(np.concatenate(([1.0], a)))).max(initial=0.0)) for a in sections)


def _polynomials(sections: Array, numerators: Array) -> tuple[Array, Array]:
    """a and b of the sum of the sections."""
    feedbacks = [np.concatenate(([1.0], a)) for a in sections]
    total = np.zeros(2 * len(sections))
    for k, b in enumerate(numerators):
        others = _product([f for j, f in enumerate(feedbacks) if j != k])
        total += np.convolve(b, others)
    return _product(feedbacks)[1:], total


def _product(polynomials: Sequence[Array]) -> Array:
    product = np.ones(1)
    for polynomial in polynomials:
        product = np.convolve(product, polynomial)
    return product
