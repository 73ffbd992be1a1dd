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

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects import Creep, ExtraDelay, ExtraResonance, SecondOrderLowPass, SensorBandwidth, Softening, ThermalDrift

LEAVES = 6.0
"""Largest V that a change may leave. If more remains, something else has changed too, or the form is different."""


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
        Part of the sentence about the stage, with a place for the size.
    """

    name: str
    family: str
    parameter: str
    unit: str
    rows: tuple[str, ...]
    words: str


KINDS: dict[str, ChangeKind] = {
    "delay": ChangeKind(ExtraDelay.name, "lag", "tau", "s", (), "{how} by {size}"),
    "low_pass": ChangeKind(SensorBandwidth.name, "lag", "tau", "s", (), "behind a low-pass of time constant {size}"),
    "low_pass_2": ChangeKind(
        SecondOrderLowPass.name, "lag", "tau", "s", (), "behind a low-pass of second order with time constant {size}"
    ),
    Creep.name: ChangeKind(Creep.name, Creep.family, "relative", "1", (Creep.name,), "with creep changed by {size}"),
    "resonance": ChangeKind(
        ExtraResonance.name, "dynamics", "f0", "Hz", ("resonance",), "with a resonance moved by {size}"
    ),
    Softening.name: ChangeKind(
        Softening.name, "dynamics", "k3", "1", (Softening.name,), "with a stiffness that depends on position, {size}"
    ),
    "drift": ChangeKind(ThermalDrift.name, "drift", "D", "m", ("drift",), "with a drift of {size} within a record"),
    "gain": ChangeKind("gain", "static", "relative_change", "1", (), "with a gain changed by {size}"),
    "loop": ChangeKind("loop_height", "hysteresis", "relative_change", "1", (), "with a loop changed by {size}"),
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
        95 % interval of the size, with pieces of the records as independent units; it includes rivals.
    rivals : tuple of str
        Keys of the changes that explain as much.
    before, after : float
        V (mean R²) with fitted gain, loop height and zero, without and with the change.
    session : mapping of str to float
        Relative changes of ``gain`` and ``loop`` that were fitted together with it.
    """

    key: str
    size: float
    interval_95: tuple[float, float]
    rivals: tuple[str, ...]
    before: float
    after: float
    session: dict[str, float]

    @property
    def kind(self) -> ChangeKind:
        """Kind of the change."""
        return KINDS[self.key]

    @property
    def member_certain(self) -> bool:
        """False if another member of the family explains as much, or if a large residual remains."""
        return self.after < LEAVES and all(KINDS[r].family != self.kind.family for r in self.rivals)

    def row(self) -> dict[str, Any]:
        """The change as an effect of ``answer.json``."""
        kind, rivals = self.kind, [KINDS[r] for r in self.rivals]
        low, high = self.interval_95
        return {
            "name": kind.name,
            "law": kind.name,
            "family": kind.family,
            "member_certain": self.member_certain,
            "explained_fraction": round(float(1.0 - np.sqrt(self.after / self.before)), 4),
            "parameters": {kind.parameter: {"value": self.size, "interval_95": [low, high], "unit": kind.unit}},
            "confusable_with": [r.name for r in rivals],
            "held_out_gain": round(float(np.log(self.before / max(self.after, 1e-12))), 4),
            "changed_parameter": True,
        }
