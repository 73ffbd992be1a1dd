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

"""Scores of model structures by cross-validation over rates, amplitudes and records; computed from inner products."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...effects import MEMORY, Arx, Creep, CreepTwoRates, EvenInputPolynomial
from ...model.model import Model
from ..fit.bounded_step import bounded_step
from ..steps.linear_start import dynamics_of
from .piece_fit import GAIN, STIFF, PieceFit
from .pieces import WEIGHTS, Kind, RecordPiece

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_LEFT_OUT = 0.75
"""Largest share of the experiment that a fold leaves out; every record has the same weight."""
FEWEST = 3
"""With fewer folds than this, every piece becomes a further fold."""
TIE = 0.02
"""Difference of scores (mean ln R²) within which the structure with fewer parameters is chosen."""
FAST, SLOW = f"{CreepTwoRates.name}.gamma_fast", f"{CreepTwoRates.name}.gamma_slow"
"""Parameters of the creep rates in the full model."""


@dataclass(frozen=True, slots=True)
class ModelStructure:
    """The optional effects of a model.

    Parameters
    ----------
    square : bool
        Whether the model has an even term of the drive.
    creep_rates : int
        Number of creep rates: 0, 1 (logarithmic) or 2.
    level : bool
        Whether the weights of the plays depend on the level.
    """

    square: bool
    creep_rates: int
    level: bool

    @property
    def size(self) -> int:
        """Number of optional parameters; one rate of creep does not count, because every piezo ceramic creeps."""
        return int(self.square) + abs(self.creep_rates - 1) + 3 * int(self.level)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the optional effects."""
        creep = ((), (Creep.name,), (CreepTwoRates.name,))[self.creep_rates]
        square = (EvenInputPolynomial.name,) if self.square else ()
        return (*square, *creep, *((MEMORY.level_term.name,) if self.level else ()))

    def is_held(self, name: str) -> bool:
        """Whether the parameter `name` is off in this structure."""
        owner = name.partition(".")[0]
        return (
            (owner == EvenInputPolynomial.name and not self.square)
            or (owner == MEMORY.level_term.name and not self.level)
            or (owner == CreepTwoRates.name and self.creep_rates == 0)
        )


STRUCTURES = tuple(
    ModelStructure(square, rates, level) for square in (False, True) for rates in (0, 1, 2) for level in (False, True)
)
"""All structures to choose from."""


@dataclass(frozen=True, eq=False, slots=True)
class Judged:
    """Score of a structure by cross-validation.

    Parameters
    ----------
    structure : ModelStructure
        The structure.
    score : float
        Mean over the folds of ln max(1, R²).
    step : (q,) ndarray
        Change of the parameters that all pieces together require.
    without : (k, q) ndarray
        The same change with each fold left out.
    """

    structure: ModelStructure
    score: float
    step: Array
    without: Array


@dataclass(frozen=True, eq=False, slots=True)
class Ranking:
    """The structures with one kind of hysteresis.

    Parameters
    ----------
    full : PieceFit
        Fit of the model with all optional effects.
    judged : tuple of Judged
        Scores of the structures, best first.
    chosen : Judged
        The simplest structure that is about as good as the best one.
    """

    full: PieceFit
    judged: tuple[Judged, ...]
    chosen: Judged

    @classmethod
    def of(cls, full: PieceFit, pieces: Sequence[RecordPiece], offered: Sequence[ModelStructure]) -> Ranking:
        """Score the structures that are offered, as `judge` does."""
        judged = sorted(judge(full, pieces, offered), key=lambda j: j.score)
        likely = [j for j in judged if not j.score > judged[0].score + TIE]
        return cls(full, tuple(judged), min(likely, key=lambda j: (j.structure.size, j.score)))

    @property
    def described(self) -> str:
        """The errors of the best structures, and of the chosen one if it is not among them."""
        listed = dict.fromkeys((*self.judged[:3], self.chosen))
        return "; ".join(f"{self.words(j)} {np.exp(0.5 * j.score):.3g}" for j in listed)

    def words(self, judged: Judged) -> str:
        """The effects of a structure."""
        loop = self.full.model.hysteresis
        return " + ".join((loop.name if loop.has_memory else "plays + cubic", *judged.structure.effects))


def folds_of(pieces: Sequence[RecordPiece]) -> list[Mask]:
    """Folds as masks of the used pieces: every rate, every amplitude and every record is left out once.

    If these are few, every piece is left out once, too. A fold never leaves out most of the experiment.
    """
    counted = [p for p in pieces if WEIGHTS[p.kind] > 0.0]
    loops = np.array([p.kind is Kind.LOOP for p in counted])
    labels = (
        np.array([p.rate for p in counted]),
        np.array([p.amplitude for p in counted]),
        np.array([p.origin for p in counted]),
    )
    sizes = np.array([p.record.size for p in counted], dtype=np.float64)
    totals = {o: sizes[labels[2] == o].sum() for o in np.unique(labels[2])}
    shares = sizes / np.array([totals[o] for o in labels[2]]) / len(totals)
    found: list[Mask] = []
    for which, label in enumerate(labels):
        values = np.unique(label[loops])
        if values.size > 1:
            found += [(label == v) & (loops | (which == 2)) for v in values]
    found = [mask for mask in found if shares[mask].sum() <= MOST_LEFT_OUT]
    if len(found) < FEWEST:
        found += [np.arange(loops.size) == k for k in np.flatnonzero(loops)]
    unique = {mask.tobytes(): mask for mask in found if not mask.all()}
    return list(unique.values())


def judge(full: PieceFit, pieces: Sequence[RecordPiece], structures: Sequence[ModelStructure]) -> Iterator[Judged]:
    """Score every structure as a part of the fitted full model, inside the bounds of its parameters.

    Parameters
    ----------
    full : PieceFit
        Fit of a model with all optional effects.
    pieces : sequence of RecordPiece
        Pieces of that fit.
    structures : sequence of ModelStructure
        Structures to score.
    """
    held = np.array([p.kind is Kind.HOLD for p in pieces if WEIGHTS[p.kind] > 0.0])
    kept = [(mask, np.where(mask, 0.0, full.weights)) for mask in folds_of(pieces)]
    others = [(mask, np.tensordot(w, full.matrices, 1) + full.prior) for mask, w in kept if w.any()]
    for structure in structures:
        free, fixed, low, high = _space(full, structure)
        whole = _solve(full.total, free, fixed, low, high)
        logs, steps = [], []
        if held.any():  # only holds show creep well, so they are not left out
            logs.append(_logs(full, whole, held, False))
        for mask, total in others:
            step = _solve(total, free, fixed, low, high)
            logs.append(_logs(full, step, mask, True))
            steps.append(step[: len(full.names)])
        numbers = len(full.names)
        score = float(np.mean(logs)) if logs else float("nan")
        yield Judged(structure, score, whole[:numbers], np.array(steps).reshape(len(steps), numbers))


def _space(full: PieceFit, structure: ModelStructure) -> tuple[Array, Array, Array, Array]:
    """Free directions of a structure, its fixed values in the other directions, and the bounds."""
    size = full.matrices.shape[1] - 1
    values = full.model.values()
    low, high = full.box()
    fixed, kept, free = np.zeros(size), list(range(size)), np.eye(size)
    for k, name in enumerate(full.names):
        if structure.is_held(name):
            fixed[k] = -values[name]
        if structure.is_held(name) or _is_of_high_order(full.model, name):
            kept.remove(k)
    if structure.creep_rates == 1 and FAST in full.names:
        fast, slow = full.names.index(FAST), full.names.index(SLOW)
        # both rates are equal and follow the fast one
        free[slow, fast] = 1.0
        fixed[slow] = values[FAST] - values[SLOW]
        kept.remove(slow)
    if GAIN in full.names and (gain := full.names.index(GAIN)) in kept:  # G(1) is constant
        for k, name in enumerate(full.names):
            if name.startswith(f"{Arx.name}.a["):
                free[gain, k] = dynamics_of(full.model).dc_gain
            elif name.startswith(f"{Arx.name}.b[") and k != gain:
                free[gain, k] = -1.0
        kept.remove(gain)
    return free[:, kept], fixed, low[kept], high[kept]


def _solve(total: Array, free: Array, fixed: Array, low: Array, high: Array) -> Array:
    hessian = free.T @ total[:-1, :-1] @ free
    diagonal = np.maximum(np.diag(hessian), 1e-30)
    slope = free.T @ (total[:-1, -1] - total[:-1, :-1] @ fixed)
    step = bounded_step(hessian + np.diag(STIFF * diagonal), slope, low - 1e-300, high + 1e-300)
    return np.asarray(fixed + free @ step)


def _logs(full: PieceFit, step: Array, mask: Mask, zero_free: bool) -> float:
    """Mean ln max(1, R²) of the pieces in `mask`; the zero of a run without fitted pieces is free."""
    numbers, step = len(full.names), step.copy()
    own, counts = full.matrices[mask], np.diagonal(full.matrices, axis1=1, axis2=2)
    for z in range(numbers, numbers + full.runs) if zero_free else ():
        if counts[mask, z].any() and not counts[~mask, z].any():
            row = own[:, z].sum(axis=0)
            step[z] = 0.0
            step[z] = (row[-1] - row[:-1] @ step) / row[z]
    ahead = np.append(-step, 1.0)  # the residual after this step
    return float(np.mean(np.log(np.maximum(1.0, own @ ahead @ ahead))))


def _is_of_high_order(model: Model, name: str) -> bool:
    """Coefficients of dynamics with more than one pole. They are not adjusted: few records determine them."""
    return name.startswith(f"{Arx.name}.") and dynamics_of(model).array("a").size > 1
