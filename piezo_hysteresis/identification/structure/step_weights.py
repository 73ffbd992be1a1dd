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

import numpy as np
from numpy.typing import NDArray

from .piece_fit import DELAY, PieceFit
from .pieces import Kind, RecordPiece

Array = NDArray[np.float64]

UNHEARD = 1e-3
"""Share of the usual weight of steps with which they only determine what no other motion shows."""
ALIKE = 10.0
"""Ratio of the mean square misfit of a step to that of all other pieces from which the step has less weight."""


def shares_of_steps(kinds: Sequence[Kind], squares: Array, weights: Array) -> Array:
    """Share of its usual weight for every piece: less for a step with a larger misfit than the other pieces, else 1.

    This is the weight that makes the size of the misfit of a step one of the unknowns, as it does in C of the gap
    finder: half the logarithm of the mean square counts, and not the mean square.

    Parameters
    ----------
    kinds : sequence of Kind, length n
        What the drive does in every piece.
    squares : (n,) ndarray
        Mean square misfit [floors²].
    weights : (n,) ndarray
        Weights of the pieces.
    """
    steps = np.array([kind is Kind.STEP for kind in kinds])
    usual = ALIKE * max(1.0, _mean(squares, np.where(steps, 0.0, weights)))
    return np.where(steps, np.minimum(1.0, usual / np.maximum(squares, np.finfo(np.float64).tiny)), 1.0)


def discounted_steps(pieces: Sequence[RecordPiece], fit: PieceFit) -> list[RecordPiece]:
    """The pieces, where a step with a larger misfit in a fit than the others has a smaller share of its weight."""
    counted = [k for k, p in enumerate(pieces) if p.kind is not Kind.CONDITIONING]
    shares = shares_of_steps([pieces[k].kind for k in counted], fit.squares, fit.weights)
    found = list(pieces)
    for k, share in zip(counted, shares.tolist(), strict=True):
        found[k] = replace(pieces[k], share=share)
    return found


def without_steps(pieces: Sequence[RecordPiece]) -> list[RecordPiece]:
    """The pieces, where steps have hardly any weight; none if there is no step, or no second rate to show the lag."""
    if len({p.rate for p in pieces if p.kind is Kind.LOOP}) < 2 or all(p.kind is not Kind.STEP for p in pieces):
        return []
    return [replace(p, share=UNHEARD) if p.kind is Kind.STEP else p for p in pieces]


def misfit_beside_steps(fit: PieceFit, pieces: Sequence[RecordPiece]) -> float:
    """Mean square misfit of the pieces that are no steps, in floors; infinite if all are steps."""
    return _mean(fit.squares, np.where(_are_steps(pieces), 0.0, fit.weights))


def _mean(squares: Array, weights: Array) -> float:
    """Weighted mean; infinite without any weight."""
    return float(weights @ squares / weights.sum()) if weights.any() else np.inf


def lateness_of_steps(fit: PieceFit, pieces: Sequence[RecordPiece]) -> float:
    """How much later than in the model the responses to the steps begin, by their slope with the delay [samples]."""
    steps = fit.matrices[_are_steps(pieces)].sum(axis=0)
    delay = fit.names.index(DELAY)
    return float(steps[delay, -1] / steps[delay, delay])


def _are_steps(pieces: Sequence[RecordPiece]) -> NDArray[np.bool_]:
    """Which of the pieces that a fit counts are steps."""
    return np.array([p.kind is Kind.STEP for p in pieces if p.kind is not Kind.CONDITIONING])
