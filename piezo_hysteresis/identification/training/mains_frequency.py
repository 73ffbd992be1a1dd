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

"""The mains frequency in the residuals of a model: a network keeps 50 or 60 Hz to some 0.1 Hz only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...blocks.block import Array
from ...record import Record

STEPS = ((0.01, 20), (1e-3, 10), (1e-4, 10))
"""Steps between the frequencies that are tried [Hz], and their number to each side of the best one; a wave of 20 s
determines its frequency to about 1/20 Hz."""
BLOCK = 0.1
"""Time over which a wave at the nominal frequency is averaged [s]; the deviation turns its phase by 7° per harmonic."""
HARMONICS = 3
"""Number of harmonics."""
RESOLVED = 0.2
"""Longest sample period at which the mains can be seen, in mains periods."""


def mains_frequency(nominal: float, records: Sequence[Record], left: Sequence[Array], floors: Array) -> float:
    """The frequency near `nominal` whose harmonics explain most of the residuals [Hz].

    Amplitude and phase are free in every record. What counts is the share of the power that the waves explain, residual
    and floor together, summed over the records: one in which much else is missing, or whose drive has this frequency,
    counts little.

    Parameters
    ----------
    nominal : float
        50 or 60 [Hz].
    records : sequence of Record
        The records.
    left : sequence of (n,) ndarray
        Their residuals [m].
    floors : (r,) ndarray
        Their floors [m].

    Examples
    --------
    >>> t = 1e-3 * np.arange(20_000)
    >>> wave = 1e-9 * np.sin(2.0 * np.pi * 49.93 * t)
    >>> round(mains_frequency(50.0, [Record(t, wave, 1e-3)], [wave], np.array([1e-10])), 3)
    49.93
    """
    waves = [
        _Waves(nominal, record, e, float(floor))
        for record, e, floor in zip(records, left, floors, strict=True)
        if record.sample_period * nominal <= RESOLVED and record.duration > 2.0 * BLOCK
    ]
    best = 0.0
    for step, count in STEPS:
        tried = best + step * np.arange(-count, count + 1, dtype=np.float64)
        shares = sum((w.shares(tried) for w in waves), np.zeros(tried.size))
        if shares.max() > 0.0:
            best = float(tried[int(np.argmax(shares))])
    return nominal + best


class _Waves:
    """The waves of one residual at the nominal frequency and its harmonics, block by block."""

    def __init__(self, nominal: float, record: Record, left: Array, floor: float) -> None:
        length = round(BLOCK / record.sample_period)
        count = left.size // length
        kept = left[: count * length] - left[: count * length].mean()
        turn = np.exp(-2j * np.pi * nominal * record.sample_period * np.arange(kept.size))
        orders = [k for k in range(1, HARMONICS + 1) if k * nominal * record.sample_period < 0.45]
        self.all = kept.size * (float(kept @ kept) + kept.size * floor**2)
        wave, sums = kept.astype(np.complex128), list[NDArray[np.complex128]]()
        for _ in orders:
            wave *= turn
            sums.append(wave.reshape(count, length).sum(axis=1))
        self.sums = sums
        self.times = record.sample_period * length * (np.arange(count) + 0.5)

    def shares(self, deviations: Array) -> Array:
        """Shares that the harmonics of frequencies so far from the nominal one explain, (f,) for deviations (f,)."""
        turn = np.exp(-2j * np.pi * np.outer(deviations, self.times))
        wave, power = np.ones_like(turn), np.zeros(deviations.size)
        for total in self.sums:
            wave *= turn
            power += 2.0 * np.abs(wave @ total) ** 2
        return power / self.all
