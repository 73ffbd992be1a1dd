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
    if not outliers:
        return None
    rows = tuple(
        (o.stage, o.parameter, f"{o.value:.5g}", f"{o.typical:.5g}", o.unit, f"{o.distance:.1f}") for o in outliers
    )
    note = (
        f"Outlying: the median of the stage is more than {FAR:g} standard deviations from that of all stages. The "
        "standard deviation combines the spread of the stages (from their median absolute deviation) and the standard "
        "error of one recording."
    )
    header = ("stage", "parameter", "median", "all stages", "unit", "distance")
    return Table("Outlying stages", header, rows[:ROWS], note + _more(rows), frozenset({2, 3, 5}))


def change_table(changes: Sequence[ChangedStage]) -> Table | None:
    """The stages with a parameter that has changed, the largest change first."""
    if not changes:
        return None
    rows = tuple(
        (c.stage, c.parameter, f"{c.earlier:.5g}", f"{c.later:.5g}", c.unit, f"{c.distance:.1f}") for c in changes
    )
    note = (
        "Changed: the medians of the earlier and of the later half of the recordings differ by more than "
        f"{FAR:g} standard errors of the difference of two recordings."
    )
    header = ("stage", "parameter", "earlier", "later", "unit", "distance")
    return Table("Changed stages", header, rows[:ROWS], note + _more(rows), frozenset({2, 3, 5}))


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
