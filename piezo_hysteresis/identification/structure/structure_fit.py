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

"""The fit of all numbers of a structure, and what it leaves of one kind of piece."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import Arx
from ...model.model import Model
from .piece_fit import GAIN, MOST, PieceFit, fit_pieces
from .pieces import Kind, RecordPiece

FEW = 4
"""Number of linearisations after which the best start of a mode or a slope is known."""
SETTLED = 4.0
"""Mean square misfit after a step [floors²] up to which nothing else is tried."""


def free_numbers(model: Model) -> list[str]:
    """Parameters that the fit of a structure adjusts: all except fixed ones and the gauge."""
    held = {GAIN} if not model[Arx.name].values["a"] else set()
    loop = model.hysteresis
    if not loop.has_memory:
        held |= {f"{loop.name}.{n}" for n in loop.fitted_names() if n not in loop.linear_numbers()}
    return [n for n in model.values() if n not in held and not model.row(n).fixed]


def fit_structure(
    model: Model,
    pieces: Sequence[RecordPiece],
    floors: Sequence[float],
    held: Collection[str] = (),
    max_iterations: int = MOST,
) -> PieceFit:
    """Fit all free parameters of a model except those in `held`."""
    return fit_pieces(model, pieces, floors, [n for n in free_numbers(model) if n not in held], max_iterations)


def misfit_of(kind: Kind, fit: PieceFit, pieces: Sequence[RecordPiece]) -> float:
    """Mean square misfit of the pieces of one kind, in floors; infinite without any."""
    counted = [p for p in pieces if p.kind is not Kind.CONDITIONING]
    found = [s for s, p in zip(fit.squares.tolist(), counted, strict=True) if p.kind is kind]
    return float(np.mean(found)) if found else np.inf


def is_settled(fit: PieceFit, pieces: Sequence[RecordPiece]) -> bool:
    """Whether nothing else is tried for the steps: the fit describes them, or there is no step."""
    return not np.inf > misfit_of(Kind.STEP, fit, pieces) > SETTLED
