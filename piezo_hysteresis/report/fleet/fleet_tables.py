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

"""The tables about many recordings: outlying and changed stages, all stages, recordings without a result."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..tables.table import Table
from ..words import POOR
from .changes import ChangedStage
from .history import FleetHistory
from .outliers import FAR, OutlyingStage

ROWS = 40
"""Largest number of rows of a table."""
_NUMBERS = re.compile(r"\d+(\.\d+)?([eE][+-]?\d+)?")
"""Parts that differ between two messages of one kind."""


def outlier_table(outliers: Sequence[OutlyingStage]) -> Table | None:
    """The outlying stages, the farthest first."""
    note = (
        f"Outlying: the median of the stage is more than {FAR:g} standard deviations from that of all stages. The "
        "standard deviation combines the spread of the stages (from their median absolute deviation) and the standard "
        "error of one recording."
    )
    return _differences("Outlying stages", ("median", "all stages"), [(o, o.value, o.typical) for o in outliers], note)


def change_table(changes: Sequence[ChangedStage]) -> Table | None:
    """The stages with a parameter that has changed, the largest change first."""
    note = (
        "Changed: the medians of the earlier and of the later half of the recordings differ by more than "
        f"{FAR:g} standard errors of the difference of two recordings. The standard error is the spread of the "
        "recordings within the halves; in a small fleet, where it is hardly known, with the interval of a recording."
    )
    return _differences("Changed stages", ("earlier", "later"), [(c, c.earlier, c.later) for c in changes], note)


def _differences(
    title: str,
    values: tuple[str, str],
    found: Sequence[tuple[OutlyingStage | ChangedStage, float, float]],
    note: str,
) -> Table | None:
    if not found:
        return None
    rows = tuple(
        (f.stage, f.parameter, f"{first:.5g}", f"{second:.5g}", f.unit, f"{f.distance:.1f}")
        for f, first, second in found
    )
    header = ("stage", "parameter", *values, "unit", "distance")
    return Table(title, header, rows[:ROWS], note + _more(rows), frozenset({2, 3, 5}))


def stage_table(history: FleetHistory) -> Table:
    """Every stage: recordings, results, errors, verdicts; the largest median error first."""
    rows = []
    for stage in history.stages:
        member = history.stage == stage
        errors = history.error[member & np.isfinite(history.error)]
        verdicts = Counter(v.replace("_", " ") for v in history.verdict[member & history.is_done])
        median = float(np.median(errors)) if errors.size else np.inf
        rows.append(
            (
                median,
                (
                    stage,
                    f"{int(member.sum())}",
                    f"{int(np.sum(member & ~history.is_done))}",
                    f"{median:.3g}" if errors.size else "",
                    f"{errors.max():.3g}" if errors.size else "",
                    f"{int(np.sum(errors > POOR))}",
                    ", ".join(f"{count} {word}" for word, count in verdicts.most_common()),
                ),
            )
        )
    cells = tuple(row for _, row in sorted(rows, key=lambda r: -r[0]))
    header = ("stage", "recordings", "no result", "median error [%]", "largest [%]", f"above {POOR:g} %", "verdicts")
    return Table("Stages", header, cells[:ROWS], _more(cells).strip(), frozenset(range(1, 6)))


def failure_table(history: FleetHistory) -> Table | None:
    """Reasons of recordings without a result, the most frequent first, with one recording each."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i in np.flatnonzero(~history.is_done):
        said = str(history.reason[i]).replace(str(history.recording[i]), "").strip(" :")
        groups.setdefault((str(history.status[i]), _NUMBERS.sub("…", said)), []).append(int(i))
    if not groups:
        return None
    rows = tuple(
        (status.replace("_", " "), f"{len(found)}", str(history.reason[found[0]]), str(history.recording[found[0]]))
        for (status, _), found in sorted(groups.items(), key=lambda item: -len(item[1]))
    )
    header = ("status", "recordings", "reason (example)", "recording")
    return Table("Recordings without a result", header, rows[:ROWS], _more(rows).strip(), frozenset({1}))


def _more(rows: Sequence[object]) -> str:
    return f" {len(rows) - ROWS} more rows are not shown." if len(rows) > ROWS else ""
