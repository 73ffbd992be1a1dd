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

"""Score of a model: how well it predicts rates, amplitudes and records that were left out of its fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..blocks.block import Array
from ..model.model import Model
from ..record import Record
from .structure.piece_fit import PieceFit, linearised
from .structure.pieces import Kind, pieces_of
from .structure.scores import ModelStructure, judge
from .structure.structure_fit import free_numbers

WHOLE = ModelStructure(True, 2, True)
"""The structure with all effects switched on."""

SEEN = 0.05
"""Smallest share of a record from which a piece counts as a separate drive."""


def score_left_out(
    model: Model,
    records: Sequence[Record],
    floors: Sequence[float] | Array,
    fitted: Collection[int],
    *,
    adjusts: bool = True,
) -> float:
    """Mean ln max(1, R²) over rates, amplitudes and records, each left out in turn.

    Parameters
    ----------
    model : Model
        Fitted model; each refit without a fold is one linear step from its parameters.
    records : sequence of Record
        Records in order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the used records.
    adjusts : bool
        Whether the parameters are refitted to the remaining data; False for a model from other data.
    """
    names = free_numbers(model) if adjusts else []
    pieces = pieces_of(records, fitted)
    matrices, weights = linearised(model, pieces, floors, names)
    return next(judge(PieceFit(model, tuple(names), matrices, weights), pieces, (WHOLE,))).score


def has_several_drives(records: Sequence[Record], fitted: Collection[int]) -> bool:
    """Whether the loops of the records have more than one rate or more than one amplitude."""
    pieces = pieces_of(records, fitted)
    loops = [p for p in pieces if p.kind is Kind.LOOP and p.record.size > SEEN * records[p.origin].size]
    return len({p.rate for p in loops}) > 1 or len({p.amplitude for p in loops}) > 1
