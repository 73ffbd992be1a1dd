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

"""`density`: amplitude density of signals on a logarithmic frequency axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

Array = NDArray[np.float64]

BINS = 160
"""Largest number of frequencies, equally spaced on the logarithmic axis."""


def density(signals: Sequence[Array], period: float) -> tuple[Array, Array]:
    """Root of the mean power density of the signals, on one frequency axis without dc, smoothed on a log axis.

    Parameters
    ----------
    signals : sequence of (n,) ndarray
        Signals of at least 64 samples each [m].
    period : float
        Time between samples [s].

    Returns
    -------
    frequency, density : (k,) ndarray
        Frequency [Hz] and amplitude density [m/√Hz], one-sided.
    """
    segment = min(1 << 14, max(64, min(s.size for s in signals)))
    spectra = [welch(s, 1.0 / period, nperseg=segment, detrend="constant") for s in signals]
    frequency, power = spectra[0][0][1:], np.mean([p for _, p in spectra], axis=0)[1:]
    edges = np.geomspace(frequency[0], frequency[-1], BINS + 1)
    place = np.clip(np.digitize(frequency, edges) - 1, 0, BINS - 1)
    count = np.bincount(place, minlength=BINS)
    good = count > 0
    f = np.bincount(place, frequency, BINS)[good] / count[good]
    return f, np.sqrt(np.bincount(place, power, BINS)[good] / count[good])
