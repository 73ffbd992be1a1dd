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

"""The standard residual tests with their bounds."""

from __future__ import annotations

import numpy as np

from ...errors import RecordError
from ..correlation import CAPTION, correlate
from ..palette import BLACK, GREY
from .comparison import ModelComparison
from .drawing import Drawing
from .style import canvas, styled
from .thinning import thinned

SHARE = 40
"""Ratio of the length of the record to the largest lag drawn."""
WIDE = 0.1
"""Bound of the cross-correlation above which the test can only exclude a strong dependence."""


@styled
def whiteness(comparison: ModelComparison) -> Drawing | None:
    """Auto- and cross-correlation of the residual in the phase with the broadest drive."""
    now = comparison.now
    if now is None:
        return None
    for phases in (("validation",), ("multisine",), ("noise",), ("chirp",), ("triangle",)):
        members = comparison.indices(*phases)
        if members:
            break
    else:
        members = [max(now.judged, key=lambda row: row.size).index]
    record = comparison.experiment[members[0]]
    try:
        found = correlate(
            now.residuals[members[0]], record.voltage, record.sample_period, max(20, record.size // SHARE)
        )
    except RecordError:
        return None
    figure, (axes,) = canvas(1, 2, 3.0)
    scale, unit = (1e3, "ms") if found.lag[-1] < 0.5 else (1.0, "s")
    for axis, lag, values, bound, title in (
        (axes[0], found.lag, found.auto, found.auto_bound, "residual with itself"),
        (axes[1], found.cross_lag, found.cross, found.cross_bound, "residual with the drive"),
    ):
        axis.axhspan(-bound, bound, color="#dddddd", label="99 % bounds", zorder=0)
        at = thinned(values)
        axis.plot(scale * lag[at], values[at], color=BLACK, linewidth=1.2)
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        axis.set_title(f"{title}, {record.phase}")
        axis.set_xlabel(f"lag [{unit}]")
        axis.legend(loc="upper right")
    if not found.decides:
        axes[1].set_title(f"{title}, {record.phase}: undecided")
    limit = 1.1 * float(np.max(np.abs(found.cross), initial=found.cross_bound))
    axes[1].set_ylim(-limit, limit)
    axes[0].set_ylabel("correlation")
    white = "white" if found.is_white else "not white"
    free = "depends on the drive" if not found.is_independent else "does not depend on the drive"
    if found.is_independent and found.cross_bound > WIDE:
        free = f"may depend on the drive, but by less than the wide bound of {found.cross_bound:.2g}"
    if not found.decides:
        free = "may or may not depend on the drive, because the record has too few frequencies or independent samples"
    return Drawing(
        "residual_tests",
        "Residual tests",
        (
            f"In {record.phase} the residual is {white} and {free}. {CAPTION} With so many samples even "
            "a small error exceeds the bounds, so look at the size of the correlation too."
        ),
        f"Residual tests in {record.phase}: the residual is {white} and {free}; largest cross-correlation "
        f"{np.max(np.abs(found.cross)):.3g} against a bound of {found.cross_bound:.3g}.",
        figure,
        {"lag_s": found.lag, "auto": found.auto, "cross_lag_s": found.cross_lag, "cross": found.cross},
    )
