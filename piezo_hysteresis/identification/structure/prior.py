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

"""Prior knowledge of a stage: its zero wanders, it creeps at about one rate, the weights of its plays are smooth.

All priors are Gaussian and enter the normal equations of a fit. Without them, any slow motion within one record would
be fitted as slow creep, which reduces fast creep to zero and predicts motion that does not occur; and a single play
would replace a lag. Decision 23 explains the choice of the sizes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects import MEMORY, Creep, CreepTwoRates, EvenInputPolynomial
from ...model.model import Model
from .pieces import RecordPiece

Array = NDArray[np.float64]

WANDER = 0.003
"""Standard deviation of the wander of the zero in `WANDER_TIME`, as a share of the displacement scale."""
WANDER_TIME = 10.0
"""Time of that wander [s]; its variance grows with the time."""
WAVES = 6
"""Number of waves for the wander of a run of records (Karhunen-Loève expansion of a random walk)."""
CREEP, CREEP_SPREAD = 0.0125, 0.0075
"""Creep of a usual piezo ceramic, and its standard deviation [1/decade]; motion at one rate hardly determines it."""
ONE_RATE = 0.005
"""Standard deviation of the difference between fast and slow creep [1/decade]."""
SMOOTH = 0.1
"""Standard deviation of the second difference of the weights of neighbouring plays, as a share of `LOOP`."""
LEVEL = 0.5
"""Standard deviation of k_1, k_n and q of weights that depend on the level [1]."""
CURVE = 0.1
"""Standard deviation of the coefficients of the cube, the square and the fourth power of the drive [1].

Without it, small amplitudes determine them by differences of large terms, and larger amplitudes are predicted badly.
"""
LOOP = 0.25
"""Sum of the weights of a usual piezo, relative to the response."""
INDEPENDENT = 16
"""Number of independent parts of the misfit of all records, so that long records do not outweigh the prior."""


def slow_rows(pieces: Sequence[RecordPiece], scale: float) -> list[Array]:
    """Zero and wander of the run of every piece: (1 + `WAVES`, n), the zero first [m].

    Coefficients of the wander have unit variance.

    Parameters
    ----------
    pieces : sequence of RecordPiece
        Pieces in order.
    scale : float
        Displacement scale of the model [m].
    """
    begin: dict[int, float] = {}
    end: dict[int, float] = {}
    for piece in pieces:
        begin.setdefault(piece.run, piece.record.start_time)
        end[piece.run] = piece.record.start_time + piece.record.duration
    frequency = (np.arange(WAVES) + 0.5) * np.pi
    found = []
    for piece in pieces:
        whole = end[piece.run] - begin[piece.run]
        time = piece.record.start_time - begin[piece.run] + piece.record.sample_period * np.arange(piece.record.size)
        size = WANDER * scale * np.sqrt(2.0 * whole / WANDER_TIME) / frequency
        waves = size[:, None] * np.sin(frequency[:, None] * time / whole)
        found.append(np.vstack((np.ones(time.size), waves)))
    return found


def prior_of(model: Model, names: Sequence[str], slow: int) -> Array:
    """Normal equations of the prior for q parameters, zeros and wander: (q + slow + 1, q + slow + 1).

    Parameters
    ----------
    model : Model
        Model at which it is linearised.
    names : sequence of str
        Free parameters.
    slow : int
        Number of zeros and waves of all runs.
    """
    numbers, runs, values = len(names), slow // (1 + WAVES), model.values()
    place = {name: k for k, name in enumerate(names)}

    def row(terms: Sequence[tuple[str, float]], sigma: float, usual: float = 0.0) -> Array:
        """A sum of parameters that is `usual` within `sigma`, linearised at the model: (1, q + slow + 1)."""
        found = np.zeros((1, numbers + slow + 1))
        found[0, -1] = usual
        for name, factor in terms:
            found[0, place[name]] = factor
            found[0, -1] -= factor * values[name]
        return found / sigma

    waves = np.zeros((slow - runs, numbers + slow + 1))
    waves[:, numbers + runs : -1] = np.eye(slow - runs)
    rows = [waves]
    fast, late = (f"{CreepTwoRates.name}.{n}" for n in ("gamma_fast", "gamma_slow"))
    if fast in place and late in place:
        rows.append(row([(fast, 1.0), (late, -1.0)], ONE_RATE))
    rows += [row([(n, 1.0)], CREEP_SPREAD, CREEP) for n in (fast, late, f"{Creep.name}.gamma") if n in place]
    if MEMORY.name in model and f"{MEMORY.name}.c[0]" in place:
        weights = [f"{MEMORY.name}.c[{j}]" for j in range(model[MEMORY.name].array("c").size)]
        padded = [None, *weights, None]  # narrower and wider plays than these have no weight
        for around in zip(padded, weights, padded[2:], strict=False):
            rows.append(row([(n, f) for n, f in zip(around, (1.0, -2.0, 1.0), strict=True) if n], SMOOTH * LOOP))
    levels = [n for n in names if n.partition(".")[0] == MEMORY.level_term.name]
    rows += [row([(n, 1.0)], LEVEL) for n in levels]
    curves = {f"{EvenInputPolynomial.name}.{p.name}" for p in EvenInputPolynomial.parameters}
    curves.add(f"{model.hysteresis.name}.p1")
    rows += [row([(n, 1.0)], CURVE) for n in names if n in curves]
    whole = np.vstack(rows)
    return np.asarray(whole.T @ whole / INDEPENDENT)
