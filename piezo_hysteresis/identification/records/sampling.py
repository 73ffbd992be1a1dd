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

"""Conversion of every record to the sample period and length that the search needs.

A slow phase at 50 kHz is redundant, and a minute of noise contains no more information about the dynamics than a
tenth of a second. A drive that excites the dynamics but is stored at a longer period than theirs is interpolated,
because gain and group delay alone would not describe the response.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from ...blocks.block import Array
from ...record import Record
from .excitation_content import excitation_content

ENOUGH = 10_000
"""Number of samples above which a record is averaged."""
SLOWEST = 2e-3
"""Longest sample period of averaged slow records [s]; mains hum stays visible."""
FAITHFUL = 3e-4
"""Largest RMS deviation of the drive from straight lines between its block averages, relative to its range."""
PATH_LOST = 0.01
"""Largest share of the path of the drive, Σ |Δu|, that its block averages may lose; a loop remembers every turn."""
FAST = 1e-3
"""Smallest curvature of a fast drive: mean second difference over standard deviation; slow loops have 1e-5."""
SMOOTH = 5e-3
"""Largest error of a spline through every second sample of a smooth drive, relative to its range."""
MOST = 200_000
"""Largest number of samples of an interpolated record."""
ALIKE = 0.1
"""Largest relative difference, in size and in speed, between the drive of a part and the whole drive."""


def less(records: Sequence[Record], changes: Sequence[Array]) -> tuple[Record, ...]:
    """The records with one array of changes each subtracted from their displacement [m]."""
    return tuple(
        replace(r, displacement=r.displacement - c) if c.any() else r for r, c in zip(records, changes, strict=True)
    )


def slowed(record: Record) -> Record:
    """The record at a longer sample period, if it is long, its drive is slow, and block averages describe the drive.

    A record that excites the dynamics is not averaged, because at a longer period the model describes the dynamics by a
    lag only.

    Parameters
    ----------
    record : Record
        Record of any length.

    Examples
    --------
    >>> t = 2e-5 * np.arange(100_000)
    >>> slowed(Record(np.sin(2 * np.pi * t), np.sin(2 * np.pi * t), 2e-5)).size
    10000
    """
    return _averaged(record, min(record.size // ENOUGH, int(SLOWEST / record.sample_period * (1.0 + 1e-9))))


def _averaged(record: Record, factor: int) -> Record:
    is_described = factor > 1 and not _differs(record, factor) and excitation_content(record).is_slow
    return record.decimate(factor) if is_described else record


def _differs(record: Record, factor: int) -> bool:
    """Whether block averages do not describe the drive, with the jump at its beginning."""
    u = record.voltage if record.continues else np.append(np.full(factor, record.settled_voltage), record.voltage)
    blocks = u.size // factor
    means = u[: blocks * factor].reshape(blocks, factor).mean(axis=1)
    middles = factor * np.arange(blocks) + (factor - 1) / 2.0
    lines = np.interp(np.arange(u.size), middles, means)
    path, kept = (float(np.abs(np.diff(x)).sum()) for x in (u[int(middles[0]) : int(middles[-1]) + 2], means))
    deviates = bool(np.sqrt(np.mean((u - lines) ** 2)) > FAITHFUL * float(np.ptp(u)))
    return deviates or kept < (1.0 - PATH_LOST) * path


def shortened(records: Sequence[Record], most: int) -> tuple[Record, ...]:
    """Every record with about `most` samples: slow ones averaged, fast ones cut if the beginning represents all.

    A record is not cut if another one continues it, or if its drive changes. Only slow drives are averaged, as by
    `slowed`.

    Parameters
    ----------
    records : sequence of Record
        Records in order.
    most : int
        Number of samples.
    """
    followed = [*(r.continues for r in records[1:]), False]
    return tuple(
        r[:most] if r.size > most and not goes_on and _is_alike(r, most) else _averaged(r, r.size // most)
        for r, goes_on in zip(records, followed, strict=True)
    )


def _is_alike(record: Record, most: int) -> bool:
    u = record.voltage
    fast = bool(np.mean(np.abs(np.diff(u, 2))) > FAST * u.std())
    return fast and all(abs(v[: most - k].std() - v.std()) <= ALIKE * v.std() for k, v in enumerate((u, np.diff(u))))


def common_period(records: Sequence[Record]) -> float:
    """Sample period for the dynamics [s]: the shortest one of records that determine them, otherwise of all records."""
    broadband = [r.sample_period for r in records if r.size > 64 and excitation_content(r).is_broadband]
    return min(broadband or [r.sample_period for r in records])


def is_faster(record: Record, period: float) -> bool:
    """Whether the record has a shorter sample period than `period` [s]."""
    return record.sample_period < 0.999 * period


def resampled(record: Record, period: float) -> Record:
    """The record as it would have been taken at a longer sample period [s].

    Averages of both channels over the same samples would make the response earlier by half the difference of the
    periods: a held drive acts in the middle of its sample, the displacement is measured at its beginning. So the drive
    is averaged over every new sample, and the displacement is taken at its beginning. A record that is shorter than the
    new period gives one sample.

    Parameters
    ----------
    record : Record
        Record with a shorter sample period.
    period : float
        The new sample period [s].
    """
    own = record.sample_period * np.arange(record.size + 1)
    count = max(1, int(record.duration / period * (1.0 + 1e-12)))
    edges = np.minimum(period * np.arange(count + 1), own[-1])
    path = record.sample_period * np.concatenate(([0.0], np.cumsum(record.voltage)))

    def sampled(channel: Array) -> Array:
        return np.asarray(scipy.interpolate.make_interp_spline(own[:-1], channel, min(3, record.size - 1))(edges[:-1]))

    voltage = np.diff(np.interp(edges, own, path)) / np.diff(edges)
    return record.with_channels(sampled, voltage=voltage, sample_period=period, initial_voltage=record.settled_voltage)


def at_period(record: Record, period: float) -> Record:
    """The record at `period` [s], if it is faster, or slower with a drive that excites the dynamics; or unchanged."""
    if is_faster(record, period):
        return resampled(record, period)
    slower = record.sample_period > 1.001 * period and record.size > 64
    if (
        not slower
        or record.duration > MOST * period
        or excitation_content(record).is_slow
        or not _is_smooth(record.voltage)
    ):
        return record
    return _interpolated(record, period)


def _is_smooth(u: Array) -> bool:
    at = np.arange(u.size)
    between = scipy.interpolate.make_interp_spline(at[::2], u[::2])(at[1 : at.size - 1 : 2])
    return bool(np.abs(between - u[1 : u.size - 1 : 2]).max() < SMOOTH * float(np.ptp(u)))


def _interpolated(record: Record, period: float) -> Record:
    now = record.sample_period * np.arange(record.size)
    then = period * np.arange(int(now[-1] / period * (1.0 + 1e-12)) + 1)

    def spline(channel: Array) -> Array:
        return np.asarray(scipy.interpolate.make_interp_spline(now, channel, min(3, record.size - 1))(then))

    return record.with_channels(spline, sample_period=period, initial_voltage=record.settled_voltage)
