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

"""A path, its drive voltage, and the expected error."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compensation.plan import Plan
from .drawing import Drawing
from .style import MEASURED, PREDICTED, canvas, handles_of, legend_above, styled
from .thinning import thinned


@styled
def tracking(plan: Plan) -> Drawing:
    """Wanted and expected displacement, the drive voltage, and the difference."""
    figure, axes = canvas(3, 1, 6.6, sharex=True)
    time = plan.sample_period * (np.arange(plan.voltage.size) - plan.begin)
    along = time[plan.begin : plan.begin + plan.wanted.size]
    error = plan.path_predicted - plan.wanted
    _line(axes[0, 0], along, 1e6 * plan.wanted, label="wanted", **MEASURED)
    _line(axes[0, 0], time, 1e6 * plan.predicted, label="expected", **PREDICTED)
    axes[0, 0].set_ylabel("displacement [µm]")
    legend_above(figure, handles_of(axes[0, 0]))
    _line(axes[1, 0], time, plan.voltage, color="#444444")
    axes[1, 0].set_ylabel("drive voltage [V]")
    _line(axes[2, 0], along, 1e9 * error, color="#b03060")
    axes[2, 0].set_ylabel("planned error [nm]")
    axes[2, 0].set_xlabel("time from the start of the path [s]")
    for part in plan.reachability.parts:
        for axis in axes[:, 0]:
            axis.axvspan(part.begin, part.end, color="#f0d0d0", linewidth=0)
    rms = float(np.sqrt(np.mean(error**2)))
    return Drawing(
        "tracking",
        "Tracking",
        (
            "The wanted path, the drive voltage that the inverse model computes for it, and the "
            "planned error. Shaded: parts of the path that the limits of the drive do not allow."
        ),
        f"Planned error {1e9 * rms:.1f} nm rms over a range of {1e6 * plan.range:.3g} µm; drive "
        f"{plan.voltage.min():.3g} to {plan.voltage.max():.3g} V; {len(plan.reachability.parts)} unreachable parts.",
        figure,
        {
            "time_s": time,
            "voltage_V": plan.voltage,
            "expected_m": plan.predicted,
            "path_time_s": along,
            "wanted_m": plan.wanted,
        },
    )


def _line(axis: Any, x: NDArray[Any], y: NDArray[Any], **style: Any) -> None:
    at = thinned(np.asarray(y, dtype=np.float64))
    axis.plot(x[at], y[at], **style)
