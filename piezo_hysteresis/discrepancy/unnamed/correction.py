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

"""`Correction`: a correction after the verdict "unknown", and the share of the gap that it removes on test records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects import UnnamedCorrection
from ...model.model import Model
from ..gap import Gap


@dataclass(frozen=True, eq=False, slots=True)
class Correction:
    """The best correction without a name, accepted or refused.

    Parameters
    ----------
    effect : UnnamedCorrection
        Form and parameters of the correction.
    displacement_scale : float
        Displacement scale of the model [m].
    model : Model or None
        The model with the correction, and its range in the provenance; None if it is refused.
    gain_rate, gain_amplitude : float
        Decrease of the mean of ln max(1, R²), with R the error in floors, on groups of similar rate, and on groups of
        similar amplitude, that were left out of the fit.
    gap : Gap or None
        Error on the test records without and with the correction; None if it was refused before.
    removed : float
        Share of the gap on these records that it removes.
    refusal : str
        Reason of the refusal; empty if it is accepted.
    """

    effect: UnnamedCorrection
    displacement_scale: float
    model: Model | None
    gain_rate: float
    gain_amplitude: float
    gap: Gap | None
    removed: float
    refusal: str

    @property
    def accepted(self) -> bool:
        """Whether it may be used inside its range."""
        return not self.refusal

    @property
    def worst(self) -> float:
        """Largest error of a test record with the correction, relative to that without it or to a larger floor."""
        return max(p.after / max(p.before, p.floor) for p in self.gap.per_phase) if self.gap is not None else np.nan

    def sentence(self) -> str:
        """The correction in words."""
        if self.model is None or self.gap is None:
            return f"A correction without a name was refused: {self.refusal}."
        known = self.model.provenance
        low, high = (float(known[key]) for key in ("voltage_min", "voltage_max"))
        slow, fast = (float(known[key]) for key in ("frequency_min", "frequency_max"))
        return (
            f"A correction without a name, a function of the {self.effect.depends_on}, removes "
            f"{100 * self.removed:.0f} % of the gap on the test records "
            f"({self.gap.before:.3g} % → {self.gap.after:.3g} % of range). It does not state the cause, and is valid "
            f"only from {low:.3g} to {high:.3g} V and from {slow:.3g} to {fast:.3g} Hz."
        )

    def answer(self) -> dict[str, Any]:
        """The correction as in ``answer.json``."""
        gap, shape = self.gap, self.effect.shape(self.displacement_scale)
        return {
            "accepted": self.accepted,
            "reason": self.sentence(),
            "form": self.effect.name,
            "depends_on": self.effect.depends_on,
            "shape": {
                "x": {"name": shape.x_name, "unit": shape.x_unit, "values": shape.x.tolist()},
                "y": {"name": shape.y_name, "unit": shape.y_unit, "values": shape.y.tolist()},
            },
            "held_out_gain": {"rate": round(self.gain_rate, 4), "amplitude": round(self.gain_amplitude, 4)},
            "removed_fraction": round(self.removed, 4),
            "gap_percent_of_range": None if gap is None else {"before": gap.before, "after": gap.after},
        }


def without_corrections(model: Model) -> Model:
    """The model without unnamed corrections, which could hide a missing effect."""
    for effect in corrections_in(model):
        model = model.without(effect.name)
    return model


def corrections_in(model: Model) -> list[UnnamedCorrection]:
    """The unnamed corrections of a model."""
    return [e for e in model.effects if isinstance(e, UnnamedCorrection)]
