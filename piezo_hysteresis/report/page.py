"""One self-contained HTML page about an experiment and the models held against it."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..identification.fit import Fit
from .answer_tables import effect_table, rejection_table, where_table
from .bode import bode
from .comparison import Comparison
from .creep import creep
from .drawing import Drawing
from .error_table import error_table, frequency_table
from .gap import gap
from .loops import loops_by_amplitude, loops_by_frequency
from .parameter_table import correlation_table, parameter_table
from .quality_table import notice_table, record_table
from .residual_maps import residual_maps
from .spectrum import residual_spectrum
from .step import step
from .style import nanometre
from .table import Table
from .time_series import time_series
from .verdict import verdict
from .whiteness import whiteness

Draw = Callable[[Comparison], Drawing | None]
Progress = Callable[[str, float], None]

SECTIONS: Mapping[str, tuple[Draw, ...]] = {
    "Errors": (gap,),
    "Hysteresis": (loops_by_amplitude, loops_by_frequency),
    "Time": (time_series, creep),
    "Dynamics": (bode, step),
    "Residual": (residual_maps, residual_spectrum, whiteness),
}
"""Headings of the page and the figures under them."""


@dataclass(frozen=True, eq=False, slots=True)
class Page:
    """The page and its figures.

    Parameters
    ----------
    html : str
        The whole page; needs no other file and no network.
    drawings : tuple of Drawing
        Its figures in order.
    """

    html: str
    drawings: tuple[Drawing, ...]

    def save(self, path: Path) -> None:
        """Write the page, and beside it a folder ``<name>_figures`` with every figure as SVG, PNG and CSV.

        Raises
        ------
        RecordingError
            If the files cannot be written.
        """
        folder = path.with_name(f"{path.stem}_figures")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(self.html, encoding="utf-8")
            for drawing in self.drawings:
                drawing.save(folder)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}; expected a folder that can be written") from None


def page(
    comparison: Comparison,
    *,
    fit: Fit | None = None,
    answer: Mapping[str, Any] | None = None,
    title: str = "Piezo stage: model against measurement",
    progress: Progress | None = None,
) -> Page:
    """Draw everything that the experiment shows and write the page.

    Parameters
    ----------
    comparison : Comparison
        Experiment and models.
    fit : Fit, optional
        Fit of the last model, for intervals, correlations and bounds.
    answer : mapping, optional
        Answer of a diagnosis, as it is written for machines.
    title : str
        Heading.
    progress : callable, optional
        Called with a word and the fraction done.
    """
    drawn: dict[str, list[Drawing]] = {}
    count = sum(len(figures) for figures in SECTIONS.values())
    done = 0
    for heading, figures in SECTIONS.items():
        for figure in figures:
            if progress is not None:
                progress(figure.__name__.replace("_", " "), done / count)
            drawing = figure(comparison)
            done += 1
            if drawing is not None:
                drawn.setdefault(heading, []).append(drawing)
    tables = _tables(comparison, fit, answer)
    headings = [h for h in (*SECTIONS, "Parameters", "Data") if h in drawn or h in tables]
    body = "".join(_section(h, tables.get(h, ()), drawn.get(h, ())) for h in headings)
    drawings = tuple(d for group in drawn.values() for d in group)
    return Page(_document(title, comparison, answer, headings, body), drawings)


def _tables(comparison: Comparison, fit: Fit | None, answer: Mapping[str, Any] | None) -> dict[str, list[Table]]:
    tables: dict[str, list[Table | None]] = {
        "Errors": [error_table(comparison), frequency_table(comparison)],
        "Data": [notice_table(comparison.experiment), record_table(comparison.experiment, comparison.noise)],
    }
    if comparison.model is not None:
        tables["Parameters"] = [parameter_table(comparison.model, fit)]
        tables["Parameters"] += [correlation_table(fit)] if fit is not None else []
    return {heading: kept for heading, found in tables.items() if (kept := [t for t in found if t is not None])}


def _section(heading: str, tables: list[Table] | tuple[()], drawings: list[Drawing] | tuple[()]) -> str:
    content = "".join(_figure(d) for d in drawings) + "".join(t.html() for t in tables)
    name = heading.lower()
    return f'<section id="{name}" aria-labelledby="{name}-h"><h2 id="{name}-h">{heading}</h2>\n{content}</section>\n'


def _figure(drawing: Drawing) -> str:
    picture, numbers = (base64.b64encode(text.encode()).decode() for text in (drawing.svg(), drawing.csv()))
    return (
        f'<h3 id="{drawing.name}">{escape(drawing.title)}</h3>\n<figure aria-labelledby="{drawing.name}">'
        f'<img alt="{escape(drawing.alternative)}" src="data:image/svg+xml;base64,{picture}">'
        f"<figcaption>{escape(drawing.caption)} "
        f'<a class="download" download="{drawing.name}.csv" href="data:text/csv;base64,{numbers}">'
        f"The numbers of “{escape(drawing.title)}” (CSV)</a></figcaption></figure>\n"
    )


def _figures_of_merit(comparison: Comparison) -> Iterator[tuple[str, str]]:
    now, before = comparison.now, comparison.before
    if now is not None:
        if before is not None:
            yield "error before", f"{before.percent:.3g} %"
        yield "error after" if before is not None else "error", f"{now.percent:.3g} %"
        yield "floor", f"{100 * float((comparison.floors**2).mean() ** 0.5) / now.range:.2g} %"
        yield "rms error", nanometre(now.rms)
        yield "range", nanometre(now.range)
    yield "phases", f"{len(comparison.experiment)}"
    yield "samples", f"{comparison.experiment.size:,}".replace(",", " ")


def _document(
    title: str, comparison: Comparison, answer: Mapping[str, Any] | None, headings: list[str], body: str
) -> str:
    said = verdict(comparison, answer)
    merit = "".join(f"<div><dt>{k}</dt><dd>{v}</dd></div>" for k, v in _figures_of_merit(comparison))
    details = (
        ""
        if answer is None
        else "".join(
            t.html() for t in (effect_table(answer), where_table(answer), rejection_table(answer)) if t is not None
        )
    )
    links = "".join(f'<li><a href="#{h.lower()}">{h}</a></li>' for h in ("Verdict", *headings))
    model = comparison.model
    chain = "no model" if model is None else " → ".join(e.name for e in model.effects)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>
{files(__package__).joinpath("page.css").read_text(encoding="utf-8")}</style>
</head>
<body>
<a class="skip" href="#verdict">Skip to the verdict</a>
<header><p>{escape(comparison.experiment.source)}</p><h1>{escape(title)}</h1>
<p>Model: {escape(chain)}</p></header>
<nav aria-label="Sections"><ul>{links}</ul></nav>
<main>
<section id="verdict" aria-labelledby="verdict-h"><h2 id="verdict-h">{escape(said.headline)}</h2>
{"".join(f"<p>{escape(s)}</p>" for s in said.sentences)}
<dl class="figures">{merit}</dl></section>
{details}{body}</main>
<footer><p>Errors are those of free-run simulation: the model sees the drive only, never the measured displacement. Per
cents are RMS over peak-to-peak displacement of the experiment. The floor of a phase is its sensor noise or 0.03 % of
range, whichever is larger.</p></footer>
</body>
</html>
"""
