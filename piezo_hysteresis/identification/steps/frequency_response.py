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

"""Empirical frequency response with its uncertainty, for comparison with the ARX model (paper, Fig. 5)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import IdentificationError
from ...record import Samples

EFFECTIVE = 1.0 / (1.0 + 2.0 / 36.0)
"""Independent averages per segment for half-overlapping Hann windows (Welch 1967)."""


@dataclass(frozen=True, eq=False, slots=True)
class FrequencyResponse:
    """G(f) estimated without a model.

    Parameters
    ----------
    frequency : (n,) array
        Frequencies [Hz].
    value : (n,) complex array
        Response, output per input.
    deviation : (n,) array
        Relative standard deviation: of |G|/|G|, and of the phase [rad].
    coherence : (n,) array
        γ², the share of the output power that is linear in the input, 0 to 1.
    """

    frequency: Samples
    value: NDArray[np.complex128]
    deviation: Samples
    coherence: Samples


def _response(
    frequency: Samples, uu: Samples, yy: Samples, uy: NDArray[np.complex128], averages: float
) -> FrequencyResponse:
    coherence = np.clip(np.abs(uy) ** 2 / np.maximum(uu * yy, 1e-300), 0.0, 1.0 - 1e-15)
    deviation = np.sqrt((1.0 - coherence) / np.maximum(2.0 * averages * coherence, 1e-300))
    return FrequencyResponse(frequency, uy / np.maximum(uu, 1e-300), deviation, coherence)


def welch(signals: Iterable[tuple[Samples, Samples]], sample_period: float, segment: int) -> FrequencyResponse:
    """Response from broadband data by averaging spectra over half-overlapping segments.

    Parameters
    ----------
    signals : iterable of (u, y)
        Input and output of every record.
    sample_period : float
        Sample period [s].
    segment : int
        Samples per segment; the resolution is its inverse length.

    Returns
    -------
    FrequencyResponse
        Response without the dc line.

    Raises
    ------
    IdentificationError
        If the data contain fewer than two segments.

    Notes
    -----
    Deviation √((1−γ²)/(2 n γ²)) with n independent averages (Bendat and Piersol, *Random Data*, Table 9.6).
    """
    window = scipy.signal.windows.hann(segment, sym=False)
    lines = segment // 2
    uu, yy, uy, count = np.zeros(lines), np.zeros(lines), np.zeros(lines, dtype=np.complex128), 0
    for u, y in signals:
        parts = 2 * (u.size // segment) - 1
        for start in range(0, max(parts, 0) * segment // 2, segment // 2):
            part = slice(start, start + segment)
            fu = np.fft.rfft(window * (u[part] - u[part].mean()))[1 : lines + 1]
            fy = np.fft.rfft(window * (y[part] - y[part].mean()))[1 : lines + 1]
            uu += np.abs(fu) ** 2
            yy += np.abs(fy) ** 2
            uy += np.conj(fu) * fy
            count += 1
    if count < 2:
        raise IdentificationError(
            f"frequency response: got under two segments of {segment} samples; use longer records or shorter segments"
        )
    return _response(np.arange(1, lines + 1) / (segment * sample_period), uu, yy, uy, EFFECTIVE * count)


def swept(signals: Iterable[tuple[Samples, Samples]], sample_period: float, neighbours: int = 16) -> FrequencyResponse:
    """Response from sweeps, by averaging over neighbouring lines of the spectrum of each whole sweep.

    Segments cannot be averaged, because a segment of a sweep contains only a part of the frequencies.

    Parameters
    ----------
    signals : iterable of (u, y)
        Input and output of every sweep, each from rest to rest.
    sample_period : float
        Sample period [s].
    neighbours : int
        Number of lines averaged into one.

    Returns
    -------
    FrequencyResponse
        Response at frequencies with at least a thousandth of the highest power.

    Raises
    ------
    IdentificationError
        If no sweep is longer than two groups of lines.
    """
    pairs = list(signals)
    size = min((u.size for u, _ in pairs), default=0)
    groups = (size // 2) // neighbours
    if groups < 2:
        raise IdentificationError(
            f"frequency response: got sweeps of {size} samples, expected {4 * neighbours} or more"
        )
    uu, yy, uy = np.zeros(groups), np.zeros(groups), np.zeros(groups, dtype=np.complex128)
    for u, y in pairs:
        fu, fy = (np.fft.rfft(x[:size] - x[0])[1 : groups * neighbours + 1].reshape(groups, -1) for x in (u, y))
        uu += np.sum(np.abs(fu) ** 2, axis=1)
        yy += np.sum(np.abs(fy) ** 2, axis=1)
        uy += np.sum(np.conj(fu) * fy, axis=1)
    frequency = np.asarray((neighbours * (np.arange(groups) + 0.5) + 0.5) / (size * sample_period), np.float64)
    excited = uu * frequency**2 > 1e-3 * float(np.max(uu * frequency**2))
    parts = frequency[excited], uu[excited], yy[excited], uy[excited]
    return _response(*parts, float(neighbours * len(pairs)))


def periodic(u: Samples, y: Samples, sample_period: float, period: int, skip: int = 1) -> FrequencyResponse:
    """Response from periodic data (multisine, sine) at the excited lines, averaged over periods, without leakage.

    Parameters
    ----------
    u, y : (n,) array
        Input and output.
    sample_period : float
        Sample period [s].
    period : int
        Samples per period.
    skip : int
        Number of periods left out at the beginning, because of the transient.

    Returns
    -------
    FrequencyResponse
        Response at the excited lines.

    Raises
    ------
    IdentificationError
        If fewer than two periods are left.
    """
    count = u.size // period - skip
    if count < 2:
        raise IdentificationError(
            f"frequency response: got {count} whole periods after the transient, expected at least 2"
        )
    whole = slice(skip * period, (skip + count) * period)
    fu = np.fft.rfft(u[whole].reshape(count, period))[:, 1:]
    fy = np.fft.rfft(y[whole].reshape(count, period))[:, 1:]
    excited = np.abs(fu.mean(axis=0)) > 1e-3 * np.abs(fu.mean(axis=0)).max()
    frequency = np.arange(1, fu.shape[1] + 1)[excited] / (period * sample_period)
    fu, fy = fu[:, excited], fy[:, excited]
    uu, yy = np.mean(np.abs(fu) ** 2, axis=0), np.mean(np.abs(fy) ** 2, axis=0)
    return _response(frequency, uu, yy, np.mean(np.conj(fu) * fy, axis=0), count)
