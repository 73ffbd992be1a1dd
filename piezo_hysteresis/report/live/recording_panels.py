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

"""Texts of the page of a recording: one phase, and all phases."""

from __future__ import annotations

from html import escape

from ..figures.comparison import ModelComparison
from ..words import duration
from .axis_state import WARN
from .panels import badge, length, table_of, table_row


def record(comparison: ModelComparison, index: int, words: str) -> str:
    """One phase of a recording: its size, its noise, and the free-run error of the model.

    Parameters
    ----------
    comparison : ModelComparison
        The recording.
    index : int
        Number of the phase.
    words : str
        Its size.
    """
    now = comparison.now
    numbers = [("sensor noise, RMS", length(float(comparison.noise[index])))]
    if now is not None:
        row = now.rows[index]
        numbers += [("residual, RMS", length(row.rms)), ("of the range", f"{row.percent:.3g} %")]
        numbers.append(("largest residual", length(row.largest)))
    cells = "".join(f"<div><dt>{label}</dt><dd>{text}</dd></div>" for label, text in numbers)
    notices = "".join(f"<p>{badge(WARN, 'data')} {escape(n.message)}</p>" for n in comparison.experiment.notices)
    return f"<p>{escape(words)}</p><dl>{cells}</dl>{notices}"


def records(comparison: ModelComparison) -> str:
    """All phases of a recording."""
    now = comparison.now
    rows = [
        table_row(
            str(k + 1),
            escape(one.phase),
            duration(one.duration),
            duration(one.sample_period),
            length(float(comparison.floors[k])),
            "—" if now is None else length(now.rows[k].rms),
        )
        for k, one in enumerate(comparison.experiment)
    ]
    head = "<tr><th></th><th>phase</th><th>duration</th><th>sample period</th><th>floor</th><th>residual, RMS</th></tr>"
    return table_of([head, *rows])
