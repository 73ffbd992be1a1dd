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

"""Delay between drive and displacement, caused by the dynamics of the stage or by a delayed channel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...record import Notice, Record, Samples
from ..segmentation.swing_shapes import turning_points

LATE = 3e-3
"""Lag [s] beyond that of any stage; a slow sensor filter or a shifted channel causes it."""

_SWING = 0.2
"""Least swing of a turning point, share of the range."""
_WINDOWS = 24
"""Approximate number of turning points that are used."""
_POINTS = 96
"""Points around every turning point."""
_EXCERPT = 1 << 20
"""Number of samples that are examined."""
_FEWEST = 6
"""Smallest number of samples on each side of a turning point."""
_FEWEST_TURNS = 2
"""Fewest turning points, because the curvature of a loop at a single one may look like a lead."""
_EXPLAINED = 0.999
"""Share of the variance that the lines must explain."""
_SURE = 4.0
"""Standard errors by which a lag must exceed zero."""
_JUMP = 0.3
"""Largest step of the drive beside a turning point, share of the swing."""
_BENT = 0.01
"""Lag that a bent loop may show, share of the swing."""
_SLOWER, _SHARED = 5.0, 2.0
"""Smallest ratio of the swing of another record to a lag that it would show, and largest ratio of a lag to that of
another record."""
_SLOW = 20e-3
"""A drive that turns faster [s] may pass a resonance, behind which a lag of over half a period looks like a lead."""


@dataclass(frozen=True, slots=True)
class Lag:
    """Lag of the displacement behind the drive.

    Parameters
    ----------
    time : float
        Lag [s]; negative where the displacement leads.
    error : float
        Its standard error [s].
    swing : float
        Usual time between two turning points [s]. What bends the loops (creep, asymmetry, more than two orders of
        hysteresis) shows as a lag or a lead of up to one per cent of it.
    """

    time: float
    error: float
    swing: float


def lag_of(record: Record) -> Lag | None:
    """Lag at the turning points of the drive; None where there are none, or the displacement does not follow the drive.

    With hysteresis alone, the displacement turns where the drive turns, and its slope changes there. Around every
    turning point the displacement is therefore a linear function of the delayed drive, with a slope for each side. The
    delay that fits best over all turns is the lag.
    """
    u, y = record.voltage[:_EXCERPT], record.displacement[:_EXCERPT]
    span = float(np.ptp(u))
    if span == 0.0:
        return None
    turns = turning_points(u, _SWING * span)
    before, at, after = turns[:-2], turns[1:-1], turns[2:]
    wide = np.minimum(at - before, after - at) >= 2 * _FEWEST
    sudden = np.maximum.reduceat(np.abs(np.diff(u, append=u[-1])), turns[:-1]) if turns.size > 1 else np.empty(0)
    wide &= np.maximum(sudden[:-1], sudden[1:]) < _JUMP * np.minimum(
        np.abs(u[at] - u[before]), np.abs(u[after] - u[at])
    )
    if wide.any():  # those at the ends of the record are shorter than the others
        length = np.minimum(at - before, after - at)
        wide &= length >= 0.6 * np.median(length[wide])
        wide &= (at >= length) & (at + length < u.size)
    chosen = np.flatnonzero(wide)[:: max(1, np.count_nonzero(wide) // _WINDOWS)]
    if chosen.size < _FEWEST_TURNS:
        return None
    half = np.minimum(at - before, after - at)[chosen] // 2
    reach = float(half.min()) / 2.0
    place = np.rint(at[chosen, None] + half[:, None] * np.linspace(-1.0, 1.0, _POINTS)).astype(np.int64)
    measured = y[place]

    def misfit(lag: float) -> float:
        return _misfit(_between(u, place - lag) - u[at[chosen], None], place - lag < at[chosen, None], measured)

    lag, least, curvature = _lowest(misfit, reach)
    if least > (1.0 - _EXPLAINED) * float(np.var(measured, axis=1).mean()) or abs(lag) > 0.9 * reach:
        return None
    error = np.sqrt(2.0 * least / measured.size / curvature) if curvature > 0.0 else reach
    period = record.sample_period
    return Lag(lag * period, float(error) * period, 2.0 * float(np.median(half)) * period)


def lag_notices(records: Sequence[Record]) -> list[Notice]:
    """Notices ``leads`` where the displacement moves before the drive does, ``late`` where it lags beyond `LATE`.

    A shifted channel and a slow filter have the same lag in all slow records. What bends a loop, such as a limit of the
    amplifier, or hum does not, so a lag that another record contradicts is no notice.
    """
    lags = [lag_of(record) for record in records]
    notices = []
    for record, lag in zip(records, lags, strict=True):
        if lag is None:
            continue
        samples = f"{abs(lag.time):.3g} s ({abs(lag.time) / record.sample_period:.2g} samples)"
        size, uncertainty = abs(lag.time), _SURE * lag.error
        peers = [o for o in lags if o is not None and o.swing > _SLOWER * size]
        sign = np.copysign(1.0, lag.time)
        shared = min((max(sign * o.time, 0.0) + _least(o) for o in peers), default=size)
        if size - uncertainty >= _SHARED * shared:
            continue
        if lag.time < -max(_least(lag), 0.5 * record.sample_period) and lag.swing > _SLOW:
            text = f"the displacement leads the voltage by {samples}; one channel is shifted, or both are swapped"
            notices.append(Notice("leads", text, record.phase, severe=True))
        elif lag.time > max(LATE, _least(lag)):
            cause = "check for a slow sensor filter, a delayed channel or a wrong time base"
            text = f"the displacement lags the voltage by {samples}; {cause}"
            notices.append(Notice("late", text, record.phase))
    return notices


def _least(lag: Lag) -> float:
    """Smallest lag that is certain beside noise and a bent loop [s]."""
    return max(_SURE * lag.error, 2.0 * _BENT * lag.swing)


def _between(values: Samples, place: Samples) -> Samples:
    """Values at fractional positions, by linear interpolation."""
    place = np.clip(place, 0.0, values.size - 1.0)
    lower = np.minimum(place.astype(np.int64), values.size - 2)
    share = place - lower
    return np.asarray((1.0 - share) * values[lower] + share * values[lower + 1])


def _misfit(away: Samples, ahead: NDArray[np.bool_], measured: Samples) -> float:
    """Mean square of the residual of every row after a fit of a constant and a parabola on each side."""
    sides = np.where(ahead, away, 0.0), np.where(ahead, 0.0, away)
    basis = np.stack((np.ones(away.shape), *sides, *(side**2 for side in sides)), axis=1)
    scale = np.maximum(np.linalg.norm(basis, axis=2, keepdims=True), 1e-300)
    basis /= scale
    gram = basis @ basis.transpose(0, 2, 1) + 1e-12 * np.eye(5)
    along = basis @ measured[:, :, None]
    left = measured - (basis.transpose(0, 2, 1) @ np.linalg.solve(gram, along))[:, :, 0]
    return float(np.mean(left**2))


def _lowest(cost: Callable[[float], float], reach: float) -> tuple[float, float, float]:
    """Position, value and curvature of the minimum within ±reach, by successively finer grids."""
    middle, width = 0.0, reach
    for points in (65, 9, 9, 9):
        grid = middle + width * np.linspace(-1.0, 1.0, points)
        costs = [cost(float(x)) for x in grid]
        best = int(np.argmin(costs))
        middle, width = float(grid[best]), 2.0 * width / (points - 1)
    low, mid, high = cost(middle - width), cost(middle), cost(middle + width)
    curvature = (low - 2.0 * mid + high) / width**2
    return middle, mid, curvature
