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

"""`fleet_page`: one page about many recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from ...errors import counted
from ..document import framed
from ..page import Page
from ..verdict import VerdictText
from ..words import POOR
from .changes import ChangedStage, changed_stages
from .fleet_figures import errors_by_stage, errors_over_time, parameters_over_time
from .fleet_tables import change_table, failure_table, outlier_table, stage_table
from .history import FleetHistory
from .outliers import OutlyingStage, outlying_stages

FOOTER = (
    "Errors are those of free-run simulation, RMS over the peak-to-peak displacement of the recording. Intervals are "
    "those of one recording; differences between recordings of a stage may be larger."
)
"""Explanation of the numbers."""


def fleet_page(history: FleetHistory) -> Page:
    """Draw and write the page.

    Parameters
    ----------
    history : FleetHistory
        History of one task.
    """
    outliers, changes = outlying_stages(history), changed_stages(history)
    candidates = {
        "Parameters": (
            [parameters_over_time(history, (*outliers, *changes))],
            [outlier_table(outliers), change_table(changes)],
        ),
        "Errors": (
            [errors_over_time(history), errors_by_stage(history)],
            [stage_table(history), failure_table(history)],
        ),
    }
    parts = {
        heading: ([d for d in drawings if d is not None], [t for t in tables if t is not None])
        for heading, (drawings, tables) in candidates.items()
    }
    parts = {heading: part for heading, part in parts.items() if any(part)}
    done = int(history.is_done.sum())
    verdict = VerdictText(
        f"{done} of {history.size} recordings have a result", tuple(_sentences(history, outliers, changes))
    )
    title, about = f"Many recordings: {history.task}", f"{counted(len(history.stages), 'stage')}"
    html = framed(title, history.source, about, verdict, tuple(_merit(history)), parts, FOOTER)
    return Page(html, tuple(d for drawings, _ in parts.values() for d in drawings))


def _sentences(
    history: FleetHistory, outliers: Sequence[OutlyingStage], changes: Sequence[ChangedStage]
) -> Iterator[str]:
    errors = history.error[np.isfinite(history.error)]
    if errors.size:
        good = int(np.sum(errors <= POOR))
        yield f"The error is at most {POOR:g} % of the range in {good} of {errors.size} recordings."
    poor = Counter(history.stage[history.error > POOR].tolist())
    if poor:
        named = ", ".join(f"{stage} ({count})" for stage, count in poor.most_common(5))
        yield f"Recordings with a larger error are most frequent at {named}; see piezo diagnose."
    doubtful = np.flatnonzero(history.is_done & (history.severe > 0))
    if doubtful.size:
        first = history.recording[doubtful[0]]
        yield (
            f"Severe findings in the data make {doubtful.size} of these results doubtful, the first that of {first}; "
            "the column `quality` of the table lists them."
        )
    if outliers:
        names = list(dict.fromkeys(o.stage for o in outliers))
        first = f"the first in {outliers[0].parameter}"
        count = "One stage differs" if len(names) == 1 else f"{len(names)} stages differ"
        yield f"{count} from the others: {', '.join(names[:5])}, {first}."
    if changes:
        names = list(dict.fromkeys(c.stage for c in changes))
        count = "One stage has" if len(names) == 1 else f"{len(names)} stages have"
        yield f"{count} changed over time: {', '.join(names[:5])}, the first in {changes[0].parameter}."
    lost = Counter(history.status[~history.is_done].tolist())
    if lost:
        words = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in lost.most_common())
        yield f"Without a result: {words}."


def _merit(history: FleetHistory) -> Iterator[tuple[str, str]]:
    errors = history.error[np.isfinite(history.error)]
    yield "recordings", f"{history.size}"
    yield "no result", f"{int(np.sum(~history.is_done))}"
    yield "stages", f"{len(history.stages)}"
    if errors.size:
        yield "median error", f"{np.median(errors):.3g} %"
        yield "largest error", f"{errors.max():.3g} %"
