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

"""The frame of the page: one HTML document without other files, network access or scripts."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from ..model.model import Model
from .figures.comparison import ModelComparison
from .figures.drawing import Drawing
from .tables.table import Table
from .verdict import VerdictText
from .words import FLOOR, nanometre

FREE_RUN = (
    "Errors are those of free-run simulation: the model uses the drive and not the measured displacement. Percentages\n"
    f"are RMS over the peak-to-peak displacement of the experiment. {FLOOR}\n"
    "Click a figure to enlarge it. piezo view EXPERIMENT shows every sample, with zoom."
)
"""Explanation of the numbers of a page about an experiment."""


def document(
    title: str,
    comparison: ModelComparison,
    verdict: VerdictText,
    parts: Mapping[str, tuple[Sequence[Drawing], Sequence[Table]]],
    answer: Mapping[str, Any] | None = None,
) -> str:
    """The whole page.

    Parameters
    ----------
    title : str
        Heading.
    comparison : ModelComparison
        Comparison, for source, chain and the numbers under the verdict.
    verdict : VerdictText
        Verdict, at the top of the page.
    parts : mapping of str to (drawings, tables)
        Contents of every section by its heading.
    answer : mapping, optional
        Answer of a diagnosis, as in the JSON file; its errors are shown under its verdict.
    """
    merit = (*_errors(comparison, answer or {}), *_sizes(comparison))
    return framed(title, comparison.experiment.source, chain(comparison.model), verdict, merit, parts, FREE_RUN)


def chain(model: Model | None) -> str:
    """The effects of a model in one line."""
    return f"Model: {'no model' if model is None else ' → '.join(e.name for e in model.effects)}"


def framed(
    title: str,
    source: str,
    about: str,
    verdict: VerdictText,
    merit: Sequence[tuple[str, str]],
    parts: Mapping[str, tuple[Sequence[Drawing], Sequence[Table]]],
    footer: str,
) -> str:
    """The frame of any page.

    Parameters
    ----------
    title, source, about : str
        Heading, location of the data, and the line under the heading.
    verdict : VerdictText
        Verdict, at the top of the page.
    merit : sequence of (str, str)
        Names and values of the numbers under the verdict.
    parts : mapping of str to (drawings, tables)
        Contents of every section by its heading.
    footer : str
        Explanation of the numbers.
    """
    return _template().render(
        title=title,
        source=source,
        about=about,
        style=files(__package__).joinpath("page.css").read_text(encoding="utf-8"),
        verdict=verdict,
        merit=merit,
        parts=parts,
        footer=footer,
    )


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader(__package__, ""), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    environment.filters["base64"] = lambda text: base64.b64encode(text.encode()).decode()
    return environment.get_template("page.html.jinja")


def _errors(comparison: ModelComparison, answer: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    now, before, gap = comparison.now, comparison.before, answer.get("gap_percent_of_range") or {}
    if gap.get("after") is not None:
        seen = "test records" if gap.get("unseen", True) else "fitted data"
        yield f"error before, {seen}", f"{gap['before']:.3g} %"
        yield f"error after, {seen}", f"{gap['after']:.3g} %"
        yield "noise floor", f"{gap['floor']:.3g} %"
    elif now is not None:
        if before is not None:
            yield "error before", f"{before.percent:.3g} %"
        yield "error after" if before is not None else "error", f"{now.percent:.3g} %"
        yield "noise floor", f"{100 * comparison.floor / now.range:.2g} %"
        yield "rms error", nanometre(now.rms)


def _sizes(comparison: ModelComparison) -> Iterator[tuple[str, str]]:
    if comparison.now is not None:
        yield "range", nanometre(comparison.now.range)
    yield "phases", f"{len(comparison.experiment)}"
    yield "samples", f"{comparison.experiment.size:,}".replace(",", " ")
