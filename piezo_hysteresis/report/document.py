"""The frame of the page: one HTML document that needs no other file, no network and no script."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files

from .figures.comparison import ModelComparison
from .figures.drawing import Drawing
from .tables.table import Table
from .verdict import VerdictText
from .words import nanometre


def document(
    title: str,
    comparison: ModelComparison,
    verdict: VerdictText,
    parts: Mapping[str, tuple[Sequence[Drawing], Sequence[Table]]],
) -> str:
    """The whole page.

    Parameters
    ----------
    title : str
        Heading.
    comparison : ModelComparison
        For source, chain and the figures under the verdict.
    verdict : VerdictText
        Comes first.
    parts : mapping of str to (drawings, tables)
        Heading of every section and what stands under it.
    """
    merit = "".join(f"<div><dt>{k}</dt><dd>{v}</dd></div>" for k, v in _figures_of_merit(comparison))
    links = "".join(f'<li><a href="#{h.lower()}">{h}</a></li>' for h in ("Verdict", *parts))
    sections = "".join(_section(heading, *part) for heading, part in parts.items())
    model = comparison.model
    chain = "no model" if model is None else " → ".join(e.name for e in model.effects)
    style = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>
{style}</style>
</head>
<body>
<a class="skip" href="#verdict">Skip to the verdict</a>
<header><p>{escape(comparison.experiment.source)}</p><h1>{escape(title)}</h1>
<p>Model: {escape(chain)}</p></header>
<nav aria-label="Sections"><ul>{links}</ul></nav>
<main>
<section id="verdict" aria-labelledby="verdict-h"><h2 id="verdict-h">{escape(verdict.headline)}</h2>
{"".join(f"<p>{escape(s)}</p>" for s in verdict.sentences)}
<dl class="figures">{merit}</dl></section>
{sections}</main>
<footer><p>Errors are those of free-run simulation: the model sees the drive only, never the measured displacement. Per
cents are RMS over peak-to-peak displacement of the experiment. The floor of a phase is its sensor noise or 0.03 % of
range, whichever is larger.</p></footer>
</body>
</html>
"""


def _section(heading: str, drawings: Sequence[Drawing], tables: Sequence[Table]) -> str:
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


def _figures_of_merit(comparison: ModelComparison) -> Iterator[tuple[str, str]]:
    now, before = comparison.now, comparison.before
    if now is not None:
        if before is not None:
            yield "error before", f"{before.percent:.3g} %"
        yield "error after" if before is not None else "error", f"{now.percent:.3g} %"
        yield "floor", f"{100 * comparison.floor / now.range:.2g} %"
        yield "rms error", nanometre(now.rms)
        yield "range", nanometre(now.range)
    yield "phases", f"{len(comparison.experiment)}"
    yield "samples", f"{comparison.experiment.size:,}".replace(",", " ")
