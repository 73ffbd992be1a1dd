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

"""Tables of the parameters of a model: values, intervals, bounds, correlations."""

from __future__ import annotations

import numpy as np

from ...effects import Arx
from ...identification.fit.fit import Fit
from ...identification.identification import scale_note
from ...identification.structure.mode import assumed_numbers
from ...model.model import Model
from ...parameter import number_text
from .table import Table

ALIKE = 0.95
"""Correlation from which two parameters are hard to distinguish."""

MOST_PAIRS = 12
"""Largest number of correlations in the table."""

MOST_SHOWN = 4
"""Largest number of array elements in the table; the model file contains all."""


def parameter_table(model: Model, fit: Fit | None = None) -> Table:
    """Every scalar parameter of the model, with its 95 % interval if it was fitted; arrays in one row each.

    A parameter at a bound has no interval: the data would move it beyond the bound. Nor have the numbers of a mode that
    was inferred from the gain, and the delay beside it: they depend on assumed values.

    Parameters
    ----------
    model : Model
        Model with values, units, bounds and meanings.
    fit : Fit, optional
        Fit of this model, for intervals and parameters at bounds; default: the intervals in the model file.
    """
    rows = []
    sure = _intervals(model, fit)
    hit = () if fit is None else fit.at_bounds
    assumed = assumed_numbers(model)
    for effect in model.effects:
        for row in effect.parameters:
            name, value = f"{effect.name}.{row.name}", effect.values[row.name]
            bounds = f"{row.lower:g} … {row.upper:g}"
            if isinstance(value, tuple):
                shown = "fitted in each record" if row.per_record else _numbers(value)
                rows.append((name, row.symbol, shown, "", row.unit, bounds, row.meaning))
                continue
            half = None if name in (*hit, *assumed) else sure.get(name)
            interval = "" if half is None else f"± {half:.2g}"
            message = f"{bounds}: at a bound" if name in hit else bounds
            rows.append((name, row.symbol, number_text(value, half), interval, row.unit, message, row.meaning))
    note = f"{scale_note(model)} Do not compare them with those of a model that has other scales."
    if Arx.name in model:
        note += (
            " Single ARX coefficients are not identifiable, because poles and zeros nearly cancel. "
            "Compare the frequency response of G instead."
        )
    return Table(
        "Parameters",
        ("name", "symbol", "value", "95 %", "unit", "bounds", "meaning"),
        tuple(rows),
        note,
        frozenset({2, 3, 5}),
    )


def _numbers(values: tuple[float, ...]) -> str:
    """An array in one cell: a few numbers, or how many there are and their range."""
    if len(values) > MOST_SHOWN:
        return f"{len(values)} from {min(values):.4g} to {max(values):.4g}"
    return ", ".join(f"{v:.4g}" for v in values) or "none"


def _intervals(model: Model, fit: Fit | None) -> dict[str, float]:
    """Half of the 95 % interval of every fitted parameter."""
    if fit is not None:
        return {n: 1.96 * s for n, s in fit.standard_errors.items()}
    known = model.covariance
    if known is None:
        return {}
    return {n: 1.96 * float(s) for n, s in zip(known.names, np.sqrt(np.diag(known.matrix)), strict=True)}


def correlation_table(fit: Fit) -> Table | None:
    """Pairs of fitted parameters with strongly correlated estimates, the strongest first; without ARX coefficients."""
    sure = fit.standard_errors
    names = [n for n in fit.names if sure[n] > 0.0 and not n.startswith((f"{Arx.name}.a", f"{Arx.name}.b"))]
    pairs = [(a, b, fit.correlation(a, b)) for i, a in enumerate(names) for b in names[:i]]
    strong = sorted((p for p in pairs if abs(p[2]) > ALIKE), key=lambda p: -abs(p[2]))
    if not strong:
        return None
    note = "The data determine a combination of the two better than each alone."
    if len(strong) > MOST_PAIRS:
        note += f" These are the {MOST_PAIRS} strongest of {len(strong)}."
    return Table(
        f"Correlations above {ALIKE:g}",
        ("one", "other", "correlation"),
        tuple((a, b, f"{c:+.3f}") for a, b, c in strong[:MOST_PAIRS]),
        note,
        frozenset({2}),
    )
