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

"""`WorkResult`: the result of one recording, in the form of a row."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..effects import Arx, ChainPosition
from ..identification.fit.fit import Fit
from ..identification.structure.mode import assumed_numbers
from ..record import Notice


@dataclass(frozen=True, slots=True)
class WorkResult:
    """The result of one task for one recording.

    Parameters
    ----------
    verdict : str
        Result in one word; docs/fleet.md lists the words.
    effects : tuple of str
        Effects of the model, or those that a diagnosis names.
    converged : bool or None
        Whether the fit converged; None if nothing was fitted.
    error : float or None
        Free-run error [m].
    error_percent, before_percent, floor_percent : float or None
        Free-run error, the error before effects were added, and the noise floor [% of range].
    parameters : tuple of mapping
        ``name``, ``value``, ``lower`` and ``upper`` (95 %, may be None), ``unit``, ``at_bound``; in SI units.
    notices : tuple of Notice
        Findings about the data.
    model : str or None
        Text of the model file.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    converged: bool | None = None
    error: float | None = None
    error_percent: float | None = None
    before_percent: float | None = None
    floor_percent: float | None = None
    parameters: tuple[Mapping[str, Any], ...] = ()
    notices: tuple[Notice, ...] = ()
    model: str | None = None

    def columns(self) -> dict[str, Any]:
        """The columns of the row; numbers that are not finite become None."""
        return {
            "verdict": self.verdict,
            "effects": list(self.effects),
            "converged": self.converged,
            "free_run_error_m": _finite(self.error),
            "free_run_error_percent": _finite(self.error_percent),
            "before_percent": _finite(self.before_percent),
            "floor_percent": _finite(self.floor_percent),
            "parameters": [dict(parameter) for parameter in self.parameters],
            "quality": [
                {"kind": n.kind, "phase": n.phase, "message": n.message, "severe": n.severe} for n in self.notices
            ],
            "severe_findings": sum(n.severe for n in self.notices),
            "model": self.model,
        }


def fitted_parameters(fit: Fit | None) -> tuple[Mapping[str, Any], ...]:
    """The fitted parameters in SI units, with their 95 % intervals, limited to their bounds.

    Like in `piezo identify --json`, values at a bound and those that were assumed have no interval.

    Every recording has scales and a sample period of its own, so the dimensionless numbers and the delays in samples of
    two recordings cannot be compared.

    Parameters
    ----------
    fit : Fit or None
        The fit; None gives an empty tuple.
    """
    return () if fit is None else tuple(_parameters(fit))


def _parameters(fit: Fit) -> Iterable[Mapping[str, Any]]:
    model = fit.model
    unsure = {*fit.at_bounds, *assumed_numbers(model)}
    for name, value in fit.values.items():
        row = model.row(name)
        lower, upper = fit.interval(name) if name not in unsure else (math.nan, math.nan)
        volts, metres = row.powers
        before_dynamics = model[name.partition(".")[0]].place is ChainPosition.HYSTERESIS
        output = model.displacement_scale * (model.effect(Arx).dc_gain if before_dynamics else 1.0)
        factor, unit = model.voltage_scale**volts * output**metres, row.physical_unit
        if unit == "samples":
            factor, unit = model.sample_period, "s"
        low, high = sorted(factor * min(max(end, row.lower), row.upper) for end in (lower, upper))
        yield {
            "name": name,
            "value": _finite(factor * value),
            "lower": _finite(low),
            "upper": _finite(high),
            "unit": unit,
            "at_bound": name in fit.at_bounds,
        }


def _finite(number: float | None) -> float | None:
    return None if number is None or not math.isfinite(number) else float(number)
