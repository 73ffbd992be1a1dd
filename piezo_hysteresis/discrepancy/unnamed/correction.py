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

"""`Correction`: what was offered after the verdict "unknown", and how much it removes where it took no part."""

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
        Its form and numbers.
    displacement_scale : float
        Of the model [m].
    model : Model or None
        The model with it, and its envelope in the provenance; None where it is refused.
    gain_rate, gain_amplitude : float
        G with groups of similar rate left out of the fit, and with groups of similar amplitude.
    gap : Gap or None
        On the records set aside, without and with the correction; None where it was refused before.
    removed : float
        Share X of the gap of these records that it removes.
    refusal : str
        Why it is refused; empty where it is accepted.
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
        """Whether it may be used inside its envelope."""
        return not self.refusal

    @property
    def worst(self) -> float:
        """Error with the correction over that without it, of the record set aside that gets worst."""
        return max(p.after / p.before for p in self.gap.per_phase) if self.gap is not None else np.nan

    def sentence(self) -> str:
        """What a user must know of it."""
        if not self.accepted:
            return f"A correction without a name was refused: {self.refusal}."
        assert self.gap is not None and self.model is not None
        known = self.model.provenance
        low, high = (float(known[key]) for key in ("voltage_min", "voltage_max"))
        slow, fast = (float(known[key]) for key in ("frequency_min", "frequency_max"))
        return (
            f"A correction without a name, a function of the {self.effect.depends_on}, removes "
            f"{100 * self.removed:.0f} % of the gap on the test records "
            f"({self.gap.before:.3g} % → {self.gap.after:.3g} % of range). It says nothing of the cause, and holds "
            f"only from {low:.3g} to {high:.3g} V and from {slow:.3g} to {fast:.3g} Hz."
        )

    def answer(self) -> dict[str, Any]:
        """As in ``answer.json``."""
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
    """The model without corrections that have no name: they would hide what is to be named."""
    for effect in model.effects:
        if isinstance(effect, UnnamedCorrection):
            model = model.without(effect.name)
    return model
