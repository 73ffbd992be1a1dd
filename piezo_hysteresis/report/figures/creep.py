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

"""Displacement while the drive is constant, on a logarithmic time axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...identification.records.edges import find_edges
from ...record import Record
from ..words import duration
from .comparison import ModelComparison
from .drawing import Drawing
from .style import BEFORE, MEASURED, PREDICTED, canvas, plain_log, styled

Array = NDArray[np.float64]

LONGEST_RAMP = 0.3
"""Longest change of level before a hold [s]."""
SHORTEST_HOLD = 0.5
"""Shortest hold that shows creep [s]."""
REFERENCE = 0.1
"""Time after the change of level at which creep is defined as zero [s]."""
POINTS = 60
"""Number of times drawn."""


@styled
def creep(comparison: ModelComparison) -> Drawing | None:
    """Displacement since 0.1 s after a change of level, in % of that change: mean over the holds."""
    holds = [h for i, r in enumerate(comparison.experiment) for h in _holds(r, i)]
    if not holds:
        return None
    together = float(np.median([length for _, _, _, length in holds]))
    holds = [hold for hold in holds if hold[3] >= 0.95 * together]
    time = np.geomspace(REFERENCE, 0.95 * together, POINTS)
    figure, axes = canvas(1, 1, 3.6)
    axis = axes[0, 0]
    data: dict[str, Array] = {"time_since_change_s": time}
    descriptions = []
    sources = [("measured", [r.displacement for r in comparison.experiment], MEASURED)]
    if comparison.before is not None:
        sources.append(("predicted before", list(comparison.before.predicted), BEFORE))
    if comparison.now is not None:
        sources.append(("predicted", list(comparison.now.predicted), PREDICTED))
    for label, signals, style in sources:
        curves = np.array(
            [_curve(comparison.experiment[i], signals[i], start, end, time) for i, start, end, _ in holds]
        )
        mean = curves.mean(axis=0)
        axis.semilogx(time, mean, label=label, **style)
        if label == "measured" and len(holds) > 2:
            spread = 2 * curves.std(axis=0, ddof=1) / np.sqrt(len(holds))
            axis.fill_between(time, mean - spread, mean + spread, color="#cccccc", linewidth=0, label="± 2 std. errors")
        data[f"{label.replace(' ', '_')}_percent"] = mean
        decades = np.log10(time[-1] / REFERENCE)
        descriptions.append(
            f"{label} {mean[-1]:.2f} % after {duration(time[-1])}, {mean[-1] / decades:.2f} % per decade"
        )
    axis.set_xlabel("time since the change of level [s]")
    plain_log(axis.xaxis)
    axis.set_ylabel("creep [% of the change]")
    axis.legend(loc="upper left")
    return Drawing(
        "creep",
        "Creep",
        (
            f"Mean over {len(holds)} holds of at least {SHORTEST_HOLD} s after a change of level, set "
            f"to zero at {REFERENCE} s. Logarithmic creep is a straight line here. Drift bends the line "
            "upwards at long times. A stage without creep and drift gives a flat line."
        ),
        "Creep: " + "; ".join(descriptions) + ".",
        figure,
        data,
    )


def _holds(record: Record, index: int) -> list[tuple[int, int, int, float]]:
    """(record, last sample before the change, first sample at the new level, length of the hold [s])."""
    period = record.sample_period
    ramp = max(2, int(LONGEST_RAMP / period))
    quiet = max(2, int(SHORTEST_HOLD / period))
    if record.size <= quiet:
        return []
    found = []
    for edge in find_edges(record.voltage, 2, quiet, tolerance=0.002, longest=ramp):
        level = record.voltage[min(edge.start + edge.quiet_after, record.size) - 1]
        away = np.abs(record.voltage[edge.start : edge.start + ramp] - level) > 0.01 * abs(edge.height)
        end = edge.start + (int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0)
        found.append((index, edge.start - 1, end, (edge.quiet_after - (end - edge.start)) * period))
    return [hold for hold in found if hold[3] > max(SHORTEST_HOLD, 2 * REFERENCE)]


def _curve(record: Record, y: Array, start: int, end: int, time: Array) -> Array:
    """Creep in % at given times after one change of level."""
    stop = min(record.size, end + int(1.05 * time[-1] / record.sample_period) + 2)
    t, part = record.sample_period * np.arange(1, stop - end + 1), y[end:stop]
    edges = np.concatenate(([time[0] / 1.1], np.sqrt(time[1:] * time[:-1]), [time[-1] * 1.1]))
    place = np.digitize(t, edges) - 1
    inside = (place >= 0) & (place < time.size)
    count = np.bincount(place[inside], minlength=time.size)
    mean = np.bincount(place[inside], part[inside], time.size) / np.maximum(count, 1)
    mean = np.where(count > 0, mean, np.interp(time, t, part))
    return np.asarray(100.0 * (mean - mean[0]) / (mean[0] - y[start]))
