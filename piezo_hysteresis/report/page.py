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

"""One self-contained HTML page that compares an experiment with models."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..identification.fit.fit import Fit
from ..recording.whole_file import whole_file
from .document import document
from .figures.bode import bode
from .figures.comparison import ModelComparison
from .figures.creep import creep
from .figures.diagnosis.correction import correction
from .figures.diagnosis.gap import gap
from .figures.diagnosis.probabilities import probabilities
from .figures.drawing import Drawing
from .figures.loops import loops_by_amplitude, loops_by_frequency
from .figures.residual_maps import residual_maps
from .figures.spectrum import residual_spectrum
from .figures.step import step
from .figures.time_series import time_series
from .figures.whiteness import whiteness
from .tables.answer_tables import correction_table, effect_table, gap_table, rejection_table, where_table
from .tables.error_table import error_table, frequency_table
from .tables.parameter_table import correlation_table, parameter_table
from .tables.probability_table import probability_table
from .tables.quality_table import notice_table, record_table
from .tables.table import Table
from .verdict import verdict

Draw = Callable[[ModelComparison], Drawing | None]
Progress = Callable[[str, float], None]

SECTIONS: Mapping[str, tuple[Draw, ...]] = {
    "Errors": (gap,),
    "Hysteresis": (loops_by_amplitude, loops_by_frequency),
    "Time": (time_series, creep),
    "Dynamics": (bode, step),
    "Residual": (residual_maps, residual_spectrum, whiteness),
}
"""Headings of the page with their figures."""


@dataclass(frozen=True, eq=False, slots=True)
class Page:
    """The page and its figures.

    Parameters
    ----------
    html : str
        The whole page, which needs no other file and no network.
    drawings : tuple of Drawing
        Figures of the page in order.
    """

    html: str
    drawings: tuple[Drawing, ...]

    def save(self, path: Path) -> None:
        """Write the page, and next to it a folder ``<name>_figures`` with every figure as SVG, PNG and CSV.

        Raises
        ------
        RecordingError
            If the files cannot be written.
        """
        folder = path.with_name(f"{path.stem}_figures")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as draft:
                draft.write_text(self.html, encoding="utf-8")
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}; expected a folder that can be written") from None
        for drawing in self.drawings:
            drawing.save(folder)


def page(
    comparison: ModelComparison,
    *,
    fit: Fit | None = None,
    answer: Mapping[str, Any] | None = None,
    title: str = "Piezo stage: model against measurement",
    progress: Progress | None = None,
) -> Page:
    """Draw all figures of the experiment and write the page.

    Parameters
    ----------
    comparison : ModelComparison
        Experiment and models.
    fit : Fit, optional
        Fit of the last model, for intervals, correlations and bounds.
    answer : mapping, optional
        Answer of a diagnosis, as in the JSON file.
    title : str
        Heading.
    progress : callable, optional
        Called with a message and the fraction done.
    """
    drawn: dict[str, list[Drawing]] = {}
    count = sum(len(figures) for figures in SECTIONS.values())
    done = 0
    if answer is not None and "live" in answer:
        drawn["Diagnosis"] = [probabilities(answer["live"])]
    if answer is not None and (shape := correction(answer)) is not None:
        drawn.setdefault("Diagnosis", []).append(shape)
    for heading, figures in SECTIONS.items():
        for figure in figures:
            if progress is not None:
                progress(figure.__name__.replace("_", " "), done / count)
            drawing = figure(comparison)
            done += 1
            if drawing is not None:
                drawn.setdefault(heading, []).append(drawing)
    tables = _tables(comparison, fit, answer)
    headings = [h for h in ("Diagnosis", *SECTIONS, "Parameters", "Data") if h in drawn or h in tables]
    parts = {h: (drawn.get(h, []), tables.get(h, [])) for h in headings}
    drawings = tuple(d for group in drawn.values() for d in group)
    return Page(document(title, comparison, verdict(comparison, answer), parts, answer), drawings)


def _tables(comparison: ModelComparison, fit: Fit | None, answer: Mapping[str, Any] | None) -> dict[str, list[Table]]:
    tables: dict[str, list[Table | None]] = {
        "Errors": [error_table(comparison), frequency_table(comparison)],
        "Data": [notice_table(comparison.experiment), record_table(comparison.experiment, comparison.noise)],
    }
    if answer is not None:
        tables["Diagnosis"] = [
            effect_table(answer),
            correction_table(answer),
            gap_table(answer),
            where_table(answer),
            rejection_table(answer),
            probability_table(answer["live"]) if "live" in answer else None,
        ]
    if comparison.model is not None:
        tables["Parameters"] = [parameter_table(comparison.model, fit)]
        tables["Parameters"] += [correlation_table(fit)] if fit is not None else []
    return {heading: kept for heading, found in tables.items() if (kept := [t for t in found if t is not None])}
