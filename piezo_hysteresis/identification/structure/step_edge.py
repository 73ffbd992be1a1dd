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

"""How a step rises: an amplifier with a largest current needs several samples for it, and so does a drive that ramps.

Slow motion is hardly late behind such an amplifier, and a stage that rings is excited less. Without it, the lag of slow
motion and that of the steps contradict each other, and the ringing has the wrong amplitude and phase.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...effects import AmplifierSlewLimitHeld
from ...record import Notice
from .mode import held_by
from .piece_fit import PieceFit, linearised
from .pieces import Kind, RecordPiece
from .structure_fit import FEW, fit_structure, is_settled

RISES = (1.1, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Start values of the rise time of the largest step [samples]."""


def with_slew_limit(found: PieceFit, pieces: Sequence[RecordPiece], floors: Sequence[float]) -> PieceFit:
    """The fit with a largest slope of the drive; `found` if no record begins with a step."""
    steps = [p.record for p in pieces if p.kind is Kind.STEP]
    height = max((abs(float(r.voltage[-1]) - r.settled_voltage) for r in steps), default=0.0)
    if height == 0.0:
        return found
    limits = (AmplifierSlewLimitHeld(S=height / (rise * found.model.sample_period)) for rise in RISES)
    models, held = [found.model.with_effect(limit) for limit in limits], held_by(found)
    if is_settled(found, pieces):
        starts = [PieceFit(m, (), *linearised(m, pieces, floors, ())) for m in models]
    else:
        starts = [fit_structure(m, pieces, floors, held, FEW) for m in models]
    return fit_structure(min(starts, key=lambda f: f.cost).model, pieces, floors, held)


def step_edge_notices(fit: PieceFit) -> list[Notice]:
    """``step_edge`` with the largest slope, if the model has one."""
    if AmplifierSlewLimitHeld.name not in fit.model:
        return []
    slope = fit.model[AmplifierSlewLimitHeld.name]["S"]
    said = f"the steps rise as behind an amplifier with a largest slope of {slope:.3g} V/s"
    return [Notice("step_edge", f"{said}; slower motion is late by a time proportional to its speed")]
