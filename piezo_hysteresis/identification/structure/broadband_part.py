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

"""The linear part of a model with broadband records: ARX dynamics, estimated again behind all effects."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from ...effects import Arx
from ...errors import IdentificationError
from ...model.model import Model
from ...record import Record
from ..fit.joint import SLOWEST_POLE, ladder, slowest_time
from ..steps.linear_start import dynamics_behind, dynamics_of, with_dynamics
from .piece_fit import DELAY, PieceFit, linearised
from .pieces import RecordPiece
from .pole_place import LinearPart
from .structure_fit import FEW, fit_structure


@dataclass(frozen=True, eq=False, slots=True)
class BroadbandPart:
    """Fits the ARX dynamics that broadband records determine.

    Parameters
    ----------
    published : Model
        Hysteresis and ARX dynamics alone, fitted jointly; their delay is kept.
    records : tuple of Record
        The experiment, in order.
    broadband : collection of int
        Indices of the records that determine the dynamics.
    orders : (int, int)
        Highest na and nb.
    """

    published: Model
    records: tuple[Record, ...]
    broadband: Collection[int]
    orders: tuple[int, int]

    def fit(self, model: Model, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> LinearPart:
        """The model with these dynamics, or with others that describe the records better behind all its effects.

        The dynamics behind the hysteresis alone stand for creep, too, as far as they can. If the effects describe the
        records worse than the published model, other dynamics would only hide this. Those with a pole so slow that it
        describes drift are not used.
        """
        start = with_dynamics(model, dynamics_of(self.published))
        held = [n for n in start.values() if n.startswith(f"{Arx.name}.")]
        first = fit_structure(start, pieces, floors, held)
        alone = PieceFit(self.published, (), *linearised(self.published, pieces, floors, ()))
        if not first.cost < alone.cost:
            return LinearPart(first, 0.0)
        begun = [fit_structure(m, pieces, floors, (DELAY,), FEW) for m in (first.model, *self._again(first.model))]
        best = min(filter(self._is_quick, begun), key=lambda f: f.cost, default=first)
        found = fit_structure(best.model, pieces, floors, (DELAY,))
        return LinearPart(next(f for f in (found, best, first) if f is first or self._is_quick(f)), 0.0)

    def _is_quick(self, fit: PieceFit) -> bool:
        """Whether the dynamics settle within the records."""
        return slowest_time(fit.model) < SLOWEST_POLE * max(r.duration for r in self.records)

    def _again(self, model: Model) -> Iterator[Model]:
        """The model with dynamics estimated again behind its effects, of every order that the ladder has."""
        delay = round(dynamics_of(model)["delay"])
        for orders in ladder(self.orders):
            with suppress(IdentificationError):
                arx = dynamics_behind(model, self.records, self.broadband, delay, orders).arx
                yield with_dynamics(model, arx)
