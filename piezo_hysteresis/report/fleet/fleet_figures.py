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

"""The figures about many recordings: parameters over time, errors over time, errors by stage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from numpy.typing import NDArray

from ..figures.drawing import Drawing
from ..figures.style import FLOOR, canvas, legend_above, plain_log, styled
from ..palette import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from ..words import POOR
from .changes import ChangedStage
from .history import FleetHistory
from .outliers import OutlyingStage

PANELS = 6
"""Largest number of parameters drawn."""
POINTS = 1500
"""Largest number of recordings drawn in a panel."""
STAGES = 30
"""Largest number of stages drawn; the worst ones are drawn."""
_MARKS = ((ORANGE, "o"), (BLUE, "s"), (GREEN, "^"), (PURPLE, "D"), (SKY, "v"))
"""Colours and marks of the stages with a separate colour."""


def apart(history: FleetHistory, found: Sequence[OutlyingStage | ChangedStage]) -> tuple[str, ...]:
    """The stages with a separate colour: all if there are few, otherwise those found, the farthest first."""
    if len(history.stages) <= len(_MARKS):
        return history.stages
    return tuple(dict.fromkeys(f.stage for f in sorted(found, key=lambda f: -f.distance)))[: len(_MARKS)]


@styled
def parameters_over_time(history: FleetHistory, found: Sequence[OutlyingStage | ChangedStage]) -> Drawing | None:
    """One panel per parameter: estimates with their intervals against the time of the recording."""
    far = {f.parameter: f.distance for f in sorted(found, key=lambda f: f.distance)}
    names = sorted(
        (n for n, s in history.parameters.items() if np.any(~np.isnat(history.time[s.index]))),
        key=lambda n: (-far.get(n, 0.0), -history.parameters[n].index.size, n),
    )[:PANELS]
    if not names:
        return None
    rows = -(-len(names) // 2)
    figure, axes = canvas(rows, min(2, len(names)), 2.4 * rows + 0.5, sharex=True)
    coloured = apart(history, found)
    handles: dict[str, Any] = {}
    data: dict[str, NDArray[Any]] = {}
    for axis, name in zip(axes.flat, names, strict=False):
        series = history.parameters[name]
        time, owner = history.time[series.index], history.stage[series.index]
        data |= {
            f"time_{name}": time.astype(str),
            f"stage_{name}": owner,
            f"{name}_{series.unit or '1'}": series.value,
            f"{name}_lower": series.lower,
            f"{name}_upper": series.upper,
        }
        for label, colour, mark, member in _groups(owner, coloured):
            chosen = _thinned(np.flatnonzero(member & ~np.isnat(time)))
            value = series.value[chosen]
            low, high = value - series.lower[chosen], series.upper[chosen] - value
            bars = np.clip(np.nan_to_num(np.stack([low, high])), 0.0, None)
            drawn = axis.errorbar(
                time[chosen], value, yerr=bars, fmt=mark, color=colour, markersize=3.5, elinewidth=0.8, alpha=0.8
            )
            handles.setdefault(label, drawn)
        axis.set_title(name)
        axis.set_ylabel(f"[{series.unit}]" if series.unit not in ("", "1") else "value")
        _dates(axis, time)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    legend_above(figure, handles)
    return Drawing(
        "parameters_over_time",
        "Parameters over time",
        "One mark per recording, with its 95 % interval. Outlying and changed stages have a separate colour. The "
        f"parameters with the largest differences come first; at most {PANELS} are drawn.",
        f"{len(names)} parameters against the date of the recording: {', '.join(names)}.",
        figure,
        data,
    )


@styled
def errors_over_time(history: FleetHistory) -> Drawing | None:
    """The free-run error of every recording, and the times of recordings without a result."""
    dated = ~np.isnat(history.time)
    known = dated & np.isfinite(history.error) & (history.error > 0.0)
    if not known.any():
        return None
    figure, axes = canvas(1, 1, 3.3)
    axis = axes[0, 0]
    handles: dict[str, Any] = {}
    for label, colour, mark, member in _groups(history.stage, _worst(history)):
        chosen = _thinned(np.flatnonzero(member & known))
        if chosen.size:
            (handles[label],) = axis.plot(
                history.time[chosen], history.error[chosen], mark, color=colour, markersize=4, alpha=0.8
            )
    handles[f"poor above {POOR:g} %"] = axis.axhline(POOR, **FLOOR)
    without = _thinned(np.flatnonzero(dated & ~history.is_done))
    if without.size:
        top = np.full(without.size, 1.3 * max(POOR, float(history.error[known].max())))
        (handles["no result"],) = axis.plot(history.time[without], top, "x", color=GREY, markersize=5)
    axis.set_yscale("log")
    plain_log(axis.yaxis)
    axis.set_ylabel("free-run error [% of range]")
    _dates(axis, history.time)
    legend_above(figure, handles)
    return Drawing(
        "errors_over_time",
        "Error over time",
        "Free-run error of every recording. Above the line, the model describes a recording poorly. Crosses are "
        "recordings without a result.",
        f"Errors of {int(known.sum())} recordings from {history.error[known].min():.2g} to "
        f"{history.error[known].max():.2g} % of range; {int(np.sum(dated & ~history.is_done))} have no result.",
        figure,
        {
            "time": history.time[known].astype(str),
            "stage": history.stage[known],
            "error_percent_of_range": history.error[known],
        },
    )


@styled
def errors_by_stage(history: FleetHistory) -> Drawing | None:
    """Median and largest error of every stage, the worst first."""
    known = np.isfinite(history.error) & (history.error > 0.0)
    if not known.any():
        return None
    stages = np.unique(history.stage[known])
    groups = [history.error[known & (history.stage == stage)] for stage in stages]
    order = np.argsort([-float(np.median(group)) for group in groups])[:STAGES]
    median, most = (np.array([float(f(groups[i])) for i in order]) for f in (np.median, np.max))
    figure, axes = canvas(1, 1, 0.27 * order.size + 1.1)
    axis, place = axes[0, 0], np.arange(order.size)
    axis.hlines(place, median, most, color="#cccccc", linewidth=2, zorder=1)
    handles = {
        "median": axis.plot(median, place, "o", color=ORANGE)[0],
        "largest": axis.plot(most, place, "s", markerfacecolor="none", color=BLUE)[0],
        f"poor above {POOR:g} %": axis.axvline(POOR, **FLOOR),
    }
    axis.set_xscale("log")
    plain_log(axis.xaxis)
    axis.set_yticks(place, [str(stages[i]) for i in order])
    axis.set_ylim(order.size - 0.4, -0.6)
    axis.set_xlabel("free-run error [% of range]")
    legend_above(figure, handles)
    return Drawing(
        "errors_by_stage",
        "Error by stage",
        "Median and largest free-run error of the recordings of a stage. If the median is large, the model does not "
        "contain an effect of the stage. If one error is large, a recording is bad, or the stage has changed.",
        f"Errors of {order.size} stages; the worst is {stages[order[0]]} with a median of {median[0]:.2g} % of range.",
        figure,
        {"stage": stages[order], "median_percent_of_range": median, "largest_percent_of_range": most},
    )


def _worst(history: FleetHistory) -> tuple[str, ...]:
    """The stages with the most poor recordings; all if there are few."""
    if len(history.stages) <= len(_MARKS):
        return history.stages
    poor = Counter(history.stage[history.error > POOR].tolist())
    return tuple(stage for stage, _ in poor.most_common(len(_MARKS)))


def _groups(owner: NDArray[Any], coloured: Sequence[str]) -> list[tuple[str, str, str, NDArray[np.bool_]]]:
    rest = ~np.isin(owner, coloured)
    groups = [("other stages", GREY, ".", rest)] if rest.any() else []
    return groups + [
        (stage, colour, mark, np.asarray(owner == stage))
        for stage, (colour, mark) in zip(coloured, _MARKS, strict=False)
    ]


def _thinned(chosen: NDArray[np.intp]) -> NDArray[np.intp]:
    return chosen[:: max(1, -(-chosen.size // POINTS))]


def _dates(axis: Any, time: NDArray[np.datetime64]) -> None:
    """Label the time axis with dates; it covers at least two days."""
    day, known = np.timedelta64(1, "D"), time[~np.isnat(time)]
    first, last = known.min(), known.max()
    margin = np.maximum((last - first) // 30, np.timedelta64(0, "D"))
    if last - first < day:
        margin = day
    axis.set_xlim(first - margin, last + margin)
    locator = AutoDateLocator(maxticks=7)
    axis.xaxis.set_major_locator(locator)
    axis.xaxis.set_major_formatter(ConciseDateFormatter(locator))
