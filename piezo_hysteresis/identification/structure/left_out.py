"""How well any model predicts rates, amplitudes and records that were left out of its fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import Arx
from ...model.model import Model
from ...record import Record
from .linear_part import free_numbers
from .piece_fit import PieceFit, cost_of, linearised
from .pieces import Kind, pieces_of
from .scores import ModelStructure, judge

WHOLE = ModelStructure(True, 2, True)
"""The structure in which nothing of a model is off."""

SEEN = 0.05
"""Share of its record that a piece must hold to count as a drive of its own."""


def score_left_out(
    model: Model, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int], *, adjusts: bool = True
) -> float:
    """Mean ln max(1, R²) over rates, amplitudes and records, each left out in turn.

    Parameters
    ----------
    model : Model
        With values from which one linear step leads to those that the rest asks for.
    records : sequence of Record
        In order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the records that count.
    adjusts : bool
        Whether the numbers of the model follow what is left; False for a model from other data, which stays as it is.
    """
    names = [n for n in free_numbers(model) if not _is_of_high_order(model, n)] if adjusts else []
    pieces = pieces_of(records, fitted)
    matrices, weights = linearised(model, pieces, floors, names)
    cost = cost_of(np.tensordot(weights, matrices, 1), len(names))
    return next(judge(PieceFit(model, tuple(names), matrices, weights, cost, True, 1), pieces, (WHOLE,))).score


def has_several_drives(records: Sequence[Record], fitted: Collection[int]) -> bool:
    """Whether the loops of the records have more than one rate or more than one amplitude."""
    pieces = pieces_of(records, fitted)
    loops = [p for p in pieces if p.kind is Kind.LOOP and p.record.size > SEEN * records[p.origin].size]
    return len({p.rate for p in loops}) > 1 or len({p.amplitude for p in loops}) > 1


def _is_of_high_order(model: Model, name: str) -> bool:
    """Coefficients of dynamics of more than one pole: they stay, since records without noise do not determine them."""
    return name.startswith(f"{Arx.name}.") and len(model[Arx.name].values["a"]) > 1  # type: ignore[arg-type]
