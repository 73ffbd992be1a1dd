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

"""Weights of steps whose response the model cannot follow, so that they do not determine the rest of the model.

A mode above half the sampling rate rings after a step, and its few samples look like any other decay. With the usual
weight they were described by a longer lag, wider plays and creep of the wrong sign, which all other motion contradicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .piece_fit import PieceFit
from .pieces import Kind, RecordPiece

ALIKE = 10.0
"""Ratio of the mean square misfit of a step to that of all other pieces from which the step has less weight."""


def discounted_steps(pieces: Sequence[RecordPiece], fit: PieceFit) -> list[RecordPiece]:
    """The pieces; a step with a larger misfit than the others has a share of its weight that is smaller by as much.

    This is the weight that makes the size of the misfit of a step one of the unknowns, as it does in C of the gap
    finder: half the logarithm of the mean square counts, and not the mean square.

    Parameters
    ----------
    pieces : sequence of RecordPiece
        Pieces in order.
    fit : PieceFit
        A fit to them.
    """
    counted = [k for k, p in enumerate(pieces) if p.kind is not Kind.CONDITIONING]
    rest = [j for j, k in enumerate(counted) if pieces[k].kind is not Kind.STEP]
    if not rest:
        return list(pieces)
    weights, squares = fit.weights, fit.squares
    usual = ALIKE * max(1.0, float(weights[rest] @ squares[rest] / weights[rest].sum()))
    found = list(pieces)
    for k, square in zip(counted, squares.tolist(), strict=True):
        if pieces[k].kind is Kind.STEP:
            found[k] = replace(pieces[k], share=min(1.0, usual / square) if square > 0.0 else 1.0)
    return found
