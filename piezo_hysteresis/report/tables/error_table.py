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

"""Tables of the free-run error: by phase, and by frequency in the form of the paper's Table 1."""

from __future__ import annotations

import math

from ..figures.comparison import ModelComparison
from .table import Table


def error_table(comparison: ModelComparison) -> Table | None:
    """Every record: its noise floor and the error of every model; for the last model also RMS, worst error and fit."""
    now = comparison.now
    if now is None:
        return None
    labels = list(comparison.models)
    rows = []
    for row in now.rows:
        errors = [f"{comparison.errors[label].rows[row.index].percent:.3f}" for label in labels]
        floor = 100.0 * comparison.floors[row.index] / now.range
        fit = "–" if math.isnan(row.fit) else f"{row.fit:.2f}"
        rows.append((row.phase, f"{row.size}", f"{floor:.3f}", *errors, _nm(row.rms), _nm(row.largest), fit))
    totals = [f"{comparison.errors[label].percent:.3f}" for label in labels]
    floor = 100.0 * comparison.floor / now.range
    whole = len(now.judged) == len(now.rows)
    rows.append(
        (
            "all phases" if whole else "all from a known state",
            f"{sum(row.size for row in now.judged)}",
            f"{floor:.3f}",
            *totals,
            _nm(now.rms),
            _nm(now.largest),
            "",
        )
    )
    header = (
        "phase",
        "samples",
        "floor [%]",
        *(f"{label} [%]" for label in labels),
        "rms [nm]",
        "worst [nm]",
        "fit [%]",
    )
    return Table(
        "Free-run error by phase",
        header,
        tuple(rows),
        f"The range is {1e6 * now.range:.4g} µm, peak to peak over the experiment. Every phase has the same weight in "
        "the last row"
        + ("" if whole else ", which leaves out phases that begin in an unknown state (conditioning, truncated)")
        + (". Fit is 100·(1 − ‖e‖/‖y − mean y‖) within the phase. It has little meaning if the stage hardly moves."),
        frozenset(range(1, len(header))),
    )


def frequency_table(comparison: ModelComparison) -> Table | None:
    """Error of every model at every frequency of the sine phases, as in the paper's Table 1."""
    now = comparison.now
    if now is None or not now.by_frequency:
        return None
    frequencies = list(now.by_frequency)
    rows = tuple(
        (f"{label} [%]", *(f"{errors.by_frequency[f]:.3f}" for f in frequencies))
        for label, errors in comparison.errors.items()
    )
    return Table(
        "Free-run error by frequency",
        ("sine of", *(f"{f:g} Hz" for f in frequencies)),
        rows,
        "",
        frozenset(range(1, len(frequencies) + 1)),
    )


def _nm(metres: float) -> str:
    return f"{1e9 * metres:.1f}"
