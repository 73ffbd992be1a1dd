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

"""The response of a filter of first or second order to a predicted signal, smooth between its samples.

If the signal were linear between samples, ringing with a quarter of the sampling rate would lose a fifth of its height,
and the time constant of the filter would be found several per cent too small.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]


def derivatives(signal: Array, before: float) -> Array:
    """Value and three derivatives [per sample] at the beginning of the interval that ends with every sample, (4, n).

    Parameters
    ----------
    signal : (n,) ndarray
        At least two samples; a cubic spline lies between them.
    before : float
        Value one sample earlier, from which the signal moves on a straight line.
    """
    pieces = scipy.interpolate.CubicSpline(np.arange(signal.size), signal).c[::-1]
    first = np.array([[before], [signal[0] - before], [0.0], [0.0]])
    return np.hstack((first, pieces * np.array([[1.0], [1.0], [2.0], [6.0]])))


def filtered(between: Array, before: float, sample_period: float, tau: float, zeta: float | None = None) -> Array:
    """A signal behind a filter that had settled at `before`, shape (n,).

    Parameters
    ----------
    between : (4, n) ndarray
        `derivatives` of the signal.
    before : float
        Value until the first sample.
    sample_period : float
        Sample period [s].
    tau : float
        Time constant [s], above 0.
    zeta : float, optional
        Damping ratio of a filter of second order; default: one pole.

    Examples
    --------
    A sine with a quarter of the sampling rate behind one pole, relative to the gain of the pole:

    >>> angle = 0.5 * np.pi
    >>> y = filtered(derivatives(np.sin(angle * np.arange(400.0)), 0.0), 0.0, 1.0, 2.0)
    >>> bool(abs(np.std(y[200:]) * 2.0**0.5 * np.hypot(1.0, 2.0 * angle) - 1.0) < 0.02)
    True
    """
    x = sample_period / tau
    rates = np.array([[-x]]) if zeta is None else np.array([[0.0, x], [-x, -2.0 * zeta * x]])
    order = len(rates)
    both = np.zeros((order + 4, order + 4))  # state of the filter, then the signal and its derivatives
    both[:order, :order], both[order - 1, order] = rates, x
    both[order:-1, order + 1 :] = np.eye(3)
    keep, push = np.split(scipy.linalg.expm(both)[:order], [order], axis=1)
    pushed = push @ between - push[:, :1] * before
    poles = np.poly(keep)
    moved = scipy.signal.lfilter([1.0, -keep[1, 1]] if order > 1 else [1.0], poles, pushed[0])
    if order > 1:
        moved = moved + scipy.signal.lfilter([0.0, keep[0, 1]], poles, pushed[1])
    return np.asarray(before + moved)


def shifted(between: Array, samples: float) -> Array:
    """A signal that is later by a number of samples, which may be negative, shape (n,); `between` as for `filtered`.

    Examples
    --------
    >>> shifted(derivatives(np.arange(10.0), -1.0), 2.5)[5:].tolist()
    [2.5, 3.5, 4.5, 5.5, 6.5]
    """
    at = np.arange(between.shape[1]) - samples
    end = np.clip(np.ceil(at).astype(int), 0, at.size - 1)
    part = np.clip(at - (end - 1), 0.0, 1.0)
    value, slope, second, third = between[:, end]
    return np.asarray(value + part * (slope + part * (second / 2.0 + part * third / 6.0)))
