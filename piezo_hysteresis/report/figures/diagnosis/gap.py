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

"""The error of every phase before and after, and its noise floor."""

from __future__ import annotations

import numpy as np

from ...palette import BLUE, GREY, ORANGE
from ..comparison import ModelComparison
from ..drawing import Drawing
from ..style import canvas, handles_of, legend_above, plain_log, styled


@styled
def gap(comparison: ModelComparison) -> Drawing | None:
    """Dots on a logarithmic axis: noise floor, error of the first model, error of the last one."""
    now, before = comparison.now, comparison.before
    if now is None:
        return None
    names = list(now.by_phase)
    place = np.arange(len(names))
    figure, axes = canvas(1, 1, 0.27 * len(names) + 1.1)
    axis = axes[0, 0]
    floors = (
        100.0
        / now.range
        * np.array(
            [np.sqrt(np.mean([comparison.floors[r.index] ** 2 for r in now.rows if r.phase == name])) for name in names]
        )
    )
    after = np.array([now.by_phase[n] for n in names])
    data = {"phase": np.array(names), "floor_percent_of_range": floors, "error_percent_of_range": after}
    axis.plot(floors, place, linestyle="none", marker="|", markersize=13, markeredgewidth=2, color=GREY, label="floor")
    shown = np.concatenate((floors, after))
    left = 0.8 * float(shown[shown > 0.0].min(initial=1.0))
    axis.barh(place, floors - left, left=left, height=0.55, color="#e8e8e8", zorder=0, label="at the floor")
    message = f"error {now.percent:.3g} % of range over all phases"
    if before is not None:
        old = np.array([before.by_phase[n] for n in names])
        axis.hlines(place, np.minimum(old, after), np.maximum(old, after), color="#cccccc", linewidth=2, zorder=1)
        axis.plot(old, place, linestyle="none", marker="s", markerfacecolor="none", color=BLUE, label="before")
        data["error_before_percent_of_range"] = old
        message = f"error {before.percent:.3g} % of range before and {now.percent:.3g} % after"
    axis.plot(
        after, place, linestyle="none", marker="o", color=ORANGE, label="after" if before is not None else "error"
    )
    axis.set_xscale("log")
    plain_log(axis.xaxis)
    axis.set_yticks(place, names)
    axis.set_xlim(left=left)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.set_xlabel("rms error [% of range]")
    legend_above(figure, handles_of(axis))
    worst = names[int(np.argmax(after))]
    return Drawing(
        "gap",
        "Error by phase",
        (
            "RMS error of every phase in free run. The noise floor is the noise of the sensor or 0.03 % of "
            "the range, whichever is larger. An error inside the grey bar is at or below the noise floor and "
            "needs no further explanation."
        ),
        f"Error by phase: {message}; worst in {worst}.",
        figure,
        data,
    )
