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

"""Possible changes of a given model, and the change that was found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..effects import (
    AmplifierBandwidth,
    Creep,
    ExtraDelay,
    ExtraResonance,
    SecondOrderLowPass,
    SensorBandwidth,
    Softening,
    ThermalDrift,
)
from ..effects.sensor.second_order_low_pass import BUTTERWORTH
from ..model.model import Model

BESSEL = 0.75**0.5
"""Damping ratio of a Bessel filter, whose delay is flat; a moving average of the same delay begins like it."""
LEAVES = 6.0
"""Largest V (mean R², with the error R in floors) that a change may leave. If more remains, something else has changed
too, or the form is different."""


@dataclass(frozen=True, slots=True)
class ChangeKind:
    """A change that can be named.

    Parameters
    ----------
    name : str
        Name of an effect of the catalogue, or ``gain``, ``loop_height``.
    family : str
        Family, as in the catalogue.
    parameter : str
        Parameter that changes.
    unit : str
        Unit of the size.
    rows : tuple of str
        Linear changes; empty if the change acts on the whole prediction.
    words : str
        What differs in the stage, with a place for the size.
    damping : float
        Damping ratio of a filter of second order.
    """

    name: str
    family: str
    parameter: str
    unit: str
    rows: tuple[str, ...]
    words: str
    damping: float = 0.0

    @property
    def lag(self) -> float:
        """Time by which slow signals are later, in units of the size; 0 where it is no lag."""
        return 0.0 if self.family != "lag" else 2.0 * self.damping or 1.0

    @property
    def cut_off(self) -> float:
        """Frequency at which a filter halves the power, in units of 1/(2π size)."""
        wide = 1.0 - 2.0 * self.damping**2
        return float(np.sqrt(wide + np.hypot(wide, 1.0))) if self.damping else 1.0

    @property
    def is_filter(self) -> bool:
        """Whether the size is the time constant of a filter."""
        return self.parameter == "tau" and self.name != ExtraDelay.name


KINDS: dict[str, ChangeKind] = {
    "delay": ChangeKind(ExtraDelay.name, "lag", "tau", "s", (), "its response is {how} by {size}"),
    "low_pass": ChangeKind(
        SensorBandwidth.name, "lag", "tau", "s", (), "a low-pass with time constant {size} follows it"
    ),
    "low_pass_before": ChangeKind(
        AmplifierBandwidth.name,
        "lag",
        "tau",
        "s",
        ("low_pass_before",),
        "a low-pass with time constant {size} precedes its hysteresis",
    ),
    **{
        key: ChangeKind(
            SecondOrderLowPass.name, "lag", "tau", "s", (), f"a {words} with time constant {{size}} follows it", damping
        )
        for key, words, damping in (
            ("low_pass_2", "low-pass of second order (Butterworth)", BUTTERWORTH),
            ("low_pass_bessel", "low-pass of second order (Bessel, or a moving average)", BESSEL),
            ("low_pass_poles", "low-pass of second order (two equal poles)", 1.0),
        )
    },
    "other_filter": ChangeKind(
        SecondOrderLowPass.name,
        "lag",
        "lag",
        "s",
        (),
        "a filter of another form (of higher order, a moving average, or with a delay) follows it",
    ),
    Creep.name: ChangeKind(Creep.name, Creep.family, "relative", "1", (Creep.name,), "its creep has changed by {size}"),
    "resonance": ChangeKind(
        ExtraResonance.name, "dynamics", "f0", "Hz", ("resonance",), "its resonance has moved by {size}"
    ),
    Softening.name: ChangeKind(
        Softening.name,
        "dynamics",
        "k3",
        "1",
        (Softening.name,),
        "its stiffness at the end of the range differs by {size}",
    ),
    "drift": ChangeKind(ThermalDrift.name, "drift", "D", "m", ("drift",), "it drifts by {size} within a record"),
    "gain": ChangeKind("gain", "static", "relative_change", "1", (), "its gain has changed by {size}"),
    "loop": ChangeKind(
        "loop_height",
        "hysteresis",
        "relative_change",
        "1",
        (),
        "the height of its hysteresis loop has changed by {size}",
    ),
}
"""Changes by the key of their signature."""


@dataclass(frozen=True, eq=False, slots=True)
class ParameterChange:
    """A change of one parameter of a model.

    Parameters
    ----------
    key : str
        Key in `KINDS`.
    size : float
        Size in the unit of its kind.
    interval_95 : (float, float)
        95 % interval of the size, with pieces of the records as independent units.
    rivals : tuple of str
        Keys of the changes that explain as much.
    before, after : float
        V (mean R²) without and with the change. Gain and loop height are fitted in both, as far as they differ from
        day to day, so V before is smaller than that of the gap.
    session : mapping of str to float
        Relative changes of the displacement (``gain``) and of the weights of the loop (``loop``) beside it.
    also : mapping of str to (float, float, float)
        Those of them that have changed by more than from day to day: change of the mean slope or of the loop height,
        and its 95 % interval.
    unseen : float
        Half interval of the lag because samples do not show when between them the stage moves [s].
    added : callable, optional
        (model, size) → the model with the change, where its form was fitted.
    """

    key: str
    size: float
    interval_95: tuple[float, float]
    rivals: tuple[str, ...]
    before: float
    after: float
    session: dict[str, float]
    also: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    unseen: float = 0.0
    added: Callable[[Model, float], Model] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of everything that has changed, this change first."""
        return self.kind.name, *(KINDS[key].name for key in self.also)

    @property
    def kind(self) -> ChangeKind:
        """Kind of the change."""
        return KINDS[self.key]

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the effects that explain as much."""
        return tuple(n for n in dict.fromkeys(KINDS[r].name for r in self.rivals) if n != self.kind.name)

    @property
    def member_certain(self) -> bool:
        """False for another form, if another member of the family explains as much, or if a large residual remains."""
        families = {KINDS[r].family for r in self.rivals if KINDS[r].name in self.others}
        return self.added is None and self.after < LEAVES and self.kind.family not in families

    @property
    def lag(self) -> tuple[float, float, float]:
        """Time by which slow signals are later, and its 95 % interval [s]; zeros where the change is no lag."""
        size, (low, high) = self.size, self.interval_95
        factor = self.kind.lag
        return factor * size, factor * low, factor * high

    @property
    def time_constants(self) -> tuple[float, float]:
        """95 % interval of the size, with filters of another damping that explain as much [unit of the kind]."""
        low, high = self.interval_95
        alike = [KINDS[r].lag for r in self.rivals if KINDS[r].damping] if self.kind.damping else []
        sizes = [self.kind.lag * self.size / lag for lag in alike]
        return min(low, *sizes, high), max(high, *sizes, low)

    @property
    def parameters(self) -> dict[str, Any]:
        """Value, interval and unit of the parameter that changed; of a filter of second order also its lag."""
        kind, lag = self.kind, self.lag
        rows = {kind.parameter: {"value": self.size, "interval_95": list(self.time_constants), "unit": kind.unit}}
        if kind.damping:
            rows["lag"] = {"value": lag[0], "interval_95": list(lag[1:]), "unit": "s"}
        return rows

    def rows(self, explained: float) -> list[dict[str, Any]]:
        """What has changed, as effects of ``answer.json``; together they explain the share `explained` of the gap."""
        common = {
            "explained_fraction": round(explained, 4),
            "held_out_gain": round(float(np.log(self.before / max(self.after, 1e-12))), 4),
            "changed_parameter": True,
        }
        found = [_row(self.kind, self.member_certain, self.parameters, self.others) | common]
        for key, (value, *interval) in self.also.items():
            kind = KINDS[key]
            numbers = {kind.parameter: {"value": value, "interval_95": interval, "unit": kind.unit}}
            found.append(_row(kind, True, numbers, ()) | common)
        return found


def _row(kind: ChangeKind, certain: bool, parameters: dict[str, Any], others: tuple[str, ...]) -> dict[str, Any]:
    return {
        "name": kind.name,
        "law": kind.name,
        "family": kind.family,
        "member_certain": certain,
        "parameters": parameters,
        "confusable_with": list(others),
    }
