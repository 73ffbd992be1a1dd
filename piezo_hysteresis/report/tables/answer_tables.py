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

"""Tables of a diagnosis: the effects found, the location of the residual, and why other effects were rejected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

from ...parameter import number_text
from ..words import FLOOR
from .table import Table

_GAP = ("before", "after", "floor")
"""Columns of the table of gaps."""


def effect_table(answer: Mapping[str, Any]) -> Table | None:
    """Every effect found, parameter by parameter, with 95 % intervals; those of an array are in the JSON answer."""
    rows = []
    for effect in answer.get("effects", ()):
        twins = ", ".join(effect["confusable_with"]) or "none"
        share = f"{100 * effect['explained_fraction']:.0f} %"
        rows += [(effect["name"], effect["family"], share, twins, *cells) for cells in _cells(effect["parameters"])]
    header = ("effect", "family", "share of the gap", "confusable with", "parameter", "value", "95 %")
    several = len({row[0] for row in rows}) > 1
    note = (
        "The share is 1 − √((V_after − 1)/(V_before − 1)), where V is the mean of (error/floor)² over the records."
        + (" It is that of all these effects together." if several else "")
    )
    return Table("Effects found", header, tuple(rows), note, frozenset({2, 5, 6})) if rows else None


def _cells(parameters: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Name, value and 95 % interval of every parameter; an array in one row, with its range."""
    for array, names in groupby(parameters, key=lambda name: name.partition("[")[0]):
        rows = [parameters[name] for name in names]
        name, values = f"{array} [{rows[0]['unit']}]", [row["value"] for row in rows]
        if array not in parameters:
            yield name, f"{len(values)} from {min(values):.4g} to {max(values):.4g}", ""
            continue
        (interval,) = (row.get("interval_95") for row in rows)
        half = 0.5 * (interval[1] - interval[0]) if interval else None
        yield name, number_text(values[0], half), " … ".join(number_text(end, half) for end in interval or ())


def correction_table(answer: Mapping[str, Any]) -> Table | None:
    """The shape of a correction without a name that was accepted, point by point."""
    correction = answer.get("unnamed_correction")
    if not correction or not correction["accepted"]:
        return None
    axes = [correction["shape"][axis] for axis in ("x", "y")]
    rows = tuple(tuple(f"{v:.3g}" for v in pair) for pair in zip(*(a["values"] for a in axes), strict=True))
    header = tuple(f"{a['name']} [{a['unit']}]" for a in axes)
    note = (
        "The correction describes the remaining residual. It has no physical name, and is not valid outside the "
        "recorded range."
    )
    return Table("Correction without a name", header, rows, note, frozenset({0, 1}))


def where_table(answer: Mapping[str, Any]) -> Table | None:
    """Axes along which the residual is concentrated, the strongest first."""
    rows = tuple(
        (place["axis"].replace("_", " "), f"{100 * place['share']:.0f} %", place["detail"])
        for place in answer.get("where", ())
        if place["detail"]
    )
    note = "Share of the residual power before an effect was added."
    return (
        Table("Where the residual is large", ("axis", "share", "detail"), rows, note, frozenset({1})) if rows else None
    )


def gap_table(answer: Mapping[str, Any]) -> Table | None:
    """Gap before and after; by phase if the diagnosis contains it."""
    gap = answer.get("gap_percent_of_range") or {}
    phases = {name: value for name, value in (gap.get("per_phase") or {}).items() if isinstance(value, Mapping)}
    rows = [(name, *(_percent(value.get(key)) for key in _GAP)) for name, value in phases.items()]
    if gap.get("before") is not None:
        rows.append(("all phases", *(_percent(gap.get(key)) for key in _GAP)))
    seen = "the test records" if gap.get("unseen", True) else "the fitted data"
    note = f"Free-run error in % of the range, on {seen}. {FLOOR}"
    return Table("Gap", ("phase", *_GAP), tuple(rows), note, frozenset({1, 2, 3})) if rows else None


def rejection_table(answer: Mapping[str, Any]) -> Table | None:
    """Effects that were tried, and the reason why each was rejected."""
    by_reason: dict[str, list[str]] = {}
    for rejected in answer.get("rejected", ()):
        by_reason.setdefault(rejected["reason"], []).append(rejected["name"])
    rows = tuple(
        (names[0], reason) if len(names) == 1 else (f"{len(names)} effects", f"{reason}: {', '.join(names)}")
        for reason, names in by_reason.items()
    )
    note = "R is the RMS residual of a record over its noise floor; the record was left out of the fit."
    return Table("Rejected", ("effect", "reason"), rows, note) if rows else None


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"
