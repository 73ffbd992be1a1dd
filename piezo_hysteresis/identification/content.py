"""`Content`: what a record can teach, judged from its drive: loops, dynamics, noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..record import Record

SLOW = 30.0
"""Drives below this [Hz] show the dynamics of a stage as a lag only."""
MANY_LINES = 48
"""Spectral lines that a drive must hold to determine orders of dynamics."""
MARKED = 0.95
"""Share of the power of dv/dt by which bandwidth and lines are counted."""


@dataclass(frozen=True, slots=True)
class Content:
    """What the drive of a record excites, and how quiet its sensor is.

    Parameters
    ----------
    span : float
        Range of the drive, the settled voltage before it included [V].
    bandwidth : float
        Frequency below which 95 % of the power of dv/dt lies [Hz].
    lines : int
        Number of spectral lines that hold 95 % of it.
    noise : float
        Standard deviation of the sensor noise [m].
    """

    span: float
    bandwidth: float
    lines: int
    noise: float

    @property
    def is_broadband(self) -> bool:
        """True where the drive determines linear dynamics."""
        return self.bandwidth > SLOW and self.lines >= MANY_LINES

    @property
    def is_slow(self) -> bool:
        """True where the stage follows the drive but for a lag."""
        return self.bandwidth <= SLOW


def content_of(record: Record) -> Content:
    """Judge a record by the spectrum of its dv/dt and the noise of its displacement."""
    drive = np.concatenate(([record.settled_voltage], record.voltage))
    speed = np.diff(drive)
    power = np.abs(np.fft.rfft(speed)) ** 2
    total = float(power.sum())
    if total == 0.0:
        return Content(0.0, 0.0, 0, noise_of(record))
    frequency = np.arange(power.size) / (speed.size * record.sample_period)
    bandwidth = float(frequency[np.searchsorted(np.cumsum(power), MARKED * total)])
    lines = int(np.searchsorted(np.cumsum(np.sort(power)[::-1]), MARKED * total)) + 1
    return Content(float(np.ptp(drive)), bandwidth, lines, noise_of(record))


def noise_of(record: Record, fewest: int = 64) -> float:
    """Standard deviation of the sensor noise [m].

    From the longest rest of the record, a parabola removed; without a rest of `fewest` samples from third differences,
    which a smooth motion leaves near zero.
    """
    y = record.displacement
    moves = np.flatnonzero(np.concatenate(([True], np.diff(record.voltage) != 0.0, [True])))
    longest = int(np.argmax(np.diff(moves))) if moves.size > 1 else 0
    start, stop = (int(moves[longest]), int(moves[longest + 1])) if moves.size > 1 else (0, y.size)
    # The stage rings after the drive stops: the later half is the rest.
    start += (stop - start) // 2 if start > 0 else 0
    if stop - start >= fewest:
        t = np.linspace(-1.0, 1.0, stop - start)
        rest = y[start:stop] - np.polynomial.Polynomial.fit(t, y[start:stop], 2)(t)
        return float(np.std(rest))
    if y.size < 8:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(y, 3))) / np.sqrt(20.0))


def excited_part(record: Record) -> Record:
    """The part of a broadband record between its ramps: where the drive is curved, not straight."""
    curved = np.abs(np.diff(record.voltage, 2))
    if not curved.size or curved.max() == 0.0:
        return record
    inside = np.flatnonzero(curved > 0.1 * np.quantile(curved, 0.95))
    start, stop = int(inside[0]), int(inside[-1]) + 2
    # At the ends of ramps a single corner is curved too; the bulk begins where curvature is dense.
    dense = np.convolve(curved > 0.1 * np.quantile(curved, 0.95), np.ones(64) / 64.0, mode="same") > 0.5
    if dense.any():
        start, stop = int(np.argmax(dense)), curved.size - int(np.argmax(dense[::-1]))
    return record[start:stop]
