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

"""Where in the chain a low-pass is: before the hysteresis, as that of an amplifier, or behind it.

The lag of slow signals is the same. But the filtered drive turns later and at smaller voltages, and after a step from
rest the displacement rises along the loop of the filtered drive. A model with the pole in the wrong place predicts
other rates and amplitudes worse, and its lag is off by up to a tenth of the time constant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects import Arx, ExtraResonance
from ...model.model import Model
from ...record import Notice
from ..steps.linear_start import dynamics_of
from ..steps.remaining_lag import AMPLIFIERS, amplifier_of, lag_beside_mode
from .mode import held_by, lag_of_mode, mode_notices
from .piece_fit import PieceFit
from .pieces import RecordPiece
from .step_edge import step_edge_notices
from .structure_fit import fit_structure

OPEN = 1.2
"""Largest ratio of the costs for which it is open where the pole is."""
POLE_GAINS = 0.98
"""A pole is accepted if at most this share of the cost remains; a first mode stays beside a second by the same rule."""
LATE = 0.1
"""Difference between the lags of steps and of other motion that is told [samples]."""


@dataclass(frozen=True, eq=False, slots=True)
class LinearPart:
    """The fit of all free parameters with the linear part that was found.

    Parameters
    ----------
    fit : PieceFit
        The fit.
    lead : float
        ln of the factor by which a ringing mode lowers the cost; 0 without such a mode.
    others : sequence of PieceFit
        Fits with the pole elsewhere in the chain, or with a largest slope of the drive.
    late : float
        How much later the steps come than all other motion says, if they contradict it [samples]; otherwise 0.
    """

    fit: PieceFit
    lead: float
    others: Sequence[PieceFit] = ()
    late: float = 0.0

    @property
    def likely(self) -> list[Model]:
        """Models with the pole elsewhere, or with a largest slope, that describe the records about as well."""
        return [f.model for f in self.others if f.cost < OPEN * self.fit.cost]

    @property
    def open_lag(self) -> float:
        """Largest difference to the lag of such a model [samples]."""
        return max((abs(_lag(m) - _lag(self.fit.model)) for m in self.likely), default=0.0)

    @property
    def leads(self) -> dict[str, float]:
        """The leads of a mode, and of a pole before the hysteresis over one behind it."""
        found = {ExtraResonance.name: self.lead}
        behind = [f.cost for f in self.others if amplifier_of(f.model) is None]
        if (amplifier := amplifier_of(self.fit.model)) and behind:
            found[amplifier.name] = float(np.log(min(behind) / self.fit.cost))
        return found

    def notices(self, final: PieceFit) -> list[Notice]:
        """``ringing``, ``step_edge``, ``amplifier`` and ``step_time``, with the numbers of the final fit."""
        found = mode_notices(final) + step_edge_notices(final)
        if pole := amplifier_of(final.model):
            said = f"a low-pass with time constant {pole['tau']:.4g} s acts before the hysteresis, as in an amplifier"
            behind = any(amplifier_of(m) is None for m in self.likely)
            found.append(Notice("amplifier", f"{said}; behind it, it is about as likely" if behind else said))
        if abs(self.late) > LATE:
            later = "later" if self.late > 0.0 else "earlier"
            said = f"the steps come {later} than all other motion, as if the drive did not jump at a sample"
            found.append(Notice("step_time", f"{said}; the lag is that of the other motion"))
        return found


FitLinearPart = Callable[[Model, Sequence[RecordPiece], Sequence[float]], LinearPart]
"""Fits the linear part of a model that has all other effects to pieces with floors [m]."""


def in_every_place(found: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> list[PieceFit]:
    """The fit, and if its dynamics have one pole, those with it before the hysteresis instead; the best one first.

    What was fitted after the pole may describe the records without it; then the fit without it is the first.
    """
    poles = real_poles(found.model)
    if len(poles) != 1:
        return [found]
    tau = -found.model.sample_period / float(np.log(poles[0]))
    bare = _without_pole(found.model, poles[0])
    forms = (bare.with_effect(form(tau=min(tau, form.parameters[0].upper))) for form in AMPLIFIERS)
    tried = (fit_structure(model, pieces, floors, held_by(found)) for model in forms)
    places = sorted((found, *tried), key=lambda f: f.cost)
    amplifier = amplifier_of(places[0].model)
    bare = places[0].model.without(amplifier.name) if amplifier else bare
    without = fit_structure(bare, pieces, floors, held_by(found))
    return places if places[0].cost < POLE_GAINS * without.cost else [without, *places]


def with_pole_behind(model: Model) -> Model:
    """The model with the pole of its amplifier as that of the dynamics behind the hysteresis."""
    amplifier = amplifier_of(model)
    if amplifier is None:
        return model
    pole = float(np.exp(-model.sample_period / amplifier["tau"])) if amplifier["tau"] > 0.0 else 0.0
    return with_pole(model.without(amplifier.name), pole)


def real_poles(model: Model) -> list[float]:
    """The poles of the dynamics that are real and positive."""
    return [float(p.real) for p in dynamics_of(model).poles if p.imag == 0.0 and p.real > 0.0]


def with_pole(model: Model, pole: float) -> Model:
    """The model with one more pole in its dynamics, at the same dc gain."""
    arx = dynamics_of(model)
    a = np.convolve((1.0, *arx.array("a")), (1.0, -pole))
    b = (1.0 - pole) * arx.array("b")
    return model.with_effect(Arx(a=tuple(a[1:].tolist()), b=tuple(b.tolist()), delay=arx["delay"]))


def _without_pole(model: Model, pole: float) -> Model:
    """The model without this pole of its dynamics, at the same dc gain."""
    arx = dynamics_of(model)
    a = np.polydiv(np.append(1.0, arx.array("a")), np.array([1.0, -pole]))[0]
    b = arx.array("b") / (1.0 - pole)
    return model.with_effect(Arx(a=tuple(a[1:].tolist()), b=tuple(b.tolist()), delay=arx["delay"]))


def _lag(model: Model) -> float:
    """Time by which slow signals are later [samples]."""
    return (lag_beside_mode(model) + lag_of_mode(model)) / model.sample_period
