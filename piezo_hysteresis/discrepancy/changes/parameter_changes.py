"""`find_change`: which parameter of a given model has changed since it was identified, and by how much.

Gain, loop height and zero differ by half a per cent from day to day; they are free beside every change, and are named
only where they changed by more. A change is named when it explains what they leave, and no other explains as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...identification.structure.pieces import WEIGHTS, pieces_of
from ...model.model import Model
from ...record import Record
from .change_kinds import KINDS, ParameterChange
from .signatures import SHAPES, ChangeablePrediction, predictions

Array = NDArray[np.float64]

EXPLAINS = 0.7
"""Share of V that a change may leave beside gain, loop height and zero."""
LEAVES, NEARLY_ALL = 4.0, 0.04
"""V, or share of V, that a change may leave: where more is left, the stage is not the same in all else."""
SEEN = 0.7
"""Size of a change, RMS in floors, from which it is reported."""
RIVAL = 1.15
"""Ratio of V up to which another change explains as much."""
GAIN, LOOP = 0.015, 0.08
"""Relative changes of gain and loop height beyond what days do."""
SHORTEST, LONGEST = 0.02, 100.0
"""Delays that are looked for [samples]."""
SURE = 2.5
"""Standard errors by which a change must differ from none."""


@dataclass(frozen=True, eq=False, slots=True)
class _Account:
    """One explanation: its cost and its numbers."""

    key: str
    cost: float
    size: float
    theta: Array
    names: tuple[str, ...]


class ChangeSearch:
    """Records, what the model predicts of them, and the accounts of the difference.

    Parameters
    ----------
    model : Model
        Given.
    records : sequence of Record
        In order.
    used : sequence of int
        Records that count.
    floors : sequence of float
        Floor of every record, the known error of the model included [m].
    """

    def __init__(self, model: Model, records: Sequence[Record], used: Sequence[int], floors: Sequence[float]) -> None:
        self.predicted = predictions(model, records)
        self.used, self.period = list(used), model.sample_period
        self.sides = ["gain"] + (["loop"] if "loop" in self.predicted[0].rows else [])
        self.weights, self.labels = self._weights(records, floors)

    def _weights(self, records: Sequence[Record], floors: Sequence[float]) -> tuple[Array, NDArray[np.int64]]:
        """Root of the weight of every sample that counts, and the piece it belongs to."""
        roots, labels = [], []
        pieces = pieces_of(records, self.used)
        for number, piece in enumerate(p for p in pieces if p.origin in self.used):
            size = piece.record.size
            weight = WEIGHTS[piece.kind] / size / floors[piece.origin] ** 2
            roots.append(np.full(size, np.sqrt(weight)))
            labels.append(np.full(size, number))
        root, label = np.concatenate(roots), np.concatenate(labels)
        floor = np.concatenate([np.full(records[i].size, floors[i]) for i in self.used])
        return root / np.sqrt(np.sum((root * floor) ** 2)), label

    def _stack(self, signals: Sequence[Array]) -> Array:
        return np.concatenate([signals[i] for i in self.used])

    def _columns(self, key: str, size: float, names: Sequence[str]) -> tuple[Array, Array]:
        """Changed prediction of all samples that count, and the columns `names` changed alike."""
        shape = SHAPES.get(key)

        def changed(p: ChangeablePrediction, signal: Array, before: float) -> Array:
            return signal if shape is None else shape(p, signal, before, size)

        y = self._stack([changed(p, p.y, p.before) for p in self.predicted])
        rows = [
            self._stack([changed(p, p.rows[n], p.before if n == "gain" else 0.0) for p in self.predicted])
            for n in names
        ]
        zeros = [
            self._stack([np.full(p.y.size, float(i == j)) for j, p in enumerate(self.predicted)]) for i in self.used
        ]
        return y, np.array([*rows, *zeros])

    def account(
        self, key: str, size: float = 0.0, sides: bool = True, mask: NDArray[np.bool_] | None = None
    ) -> _Account:
        """Least squares of the linear numbers beside a change of given size."""
        names = (*(self.sides if sides else ()), *(n for n in (KINDS[key].rows if key in KINDS else ())))
        y, columns = self._columns(key, size, names)
        root = self.weights if mask is None else np.where(mask, self.weights, 0.0)
        measured = self._stack([p.record.displacement for p in self.predicted])
        target, matrix = root * (measured - y), root * columns
        scale = np.maximum(np.linalg.norm(matrix, axis=1), 1e-300)
        gram = (matrix / scale[:, None]) @ (matrix / scale[:, None]).T
        theta = np.linalg.lstsq(gram, (matrix / scale[:, None]) @ target, rcond=1e-12)[0] / scale
        left = target - theta @ matrix
        return _Account(key, float(left @ left), size, theta, names)

    def shaped(self, key: str, mask: NDArray[np.bool_] | None = None, near: float | None = None) -> _Account:
        """The best size of a delay or of a filter."""
        period = min(p.record.sample_period for p in self.predicted)
        if near is None:
            sizes = period * np.geomspace(SHORTEST, LONGEST, 16)
            sizes = np.concatenate((-sizes[:10][::-1], sizes)) if key == "delay" else sizes
            near = float(min(sizes, key=lambda s: self.account(key, float(s), mask=mask).cost))
        low, high = sorted((0.4 * near, 2.2 * near))
        found = scipy.optimize.minimize_scalar(
            lambda s: self.account(key, float(s), mask=mask).cost,
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-3 * abs(near)},
        )
        return self.account(key, float(found.x), mask=mask)

    def best(self, key: str, mask: NDArray[np.bool_] | None = None, near: float | None = None) -> _Account:
        """The account of a change, its size in the unit of its kind."""
        if key in SHAPES:
            return self.shaped(key, mask, near)
        found = self.account(key, mask=mask)
        rows = KINDS[key].rows or (key,)
        values = dict(zip(found.names, found.theta.tolist(), strict=False))
        return _Account(key, found.cost, sum(values[r] for r in rows), found.theta, found.names)


def find_change(
    model: Model, records: Sequence[Record], used: Sequence[int], floors: Sequence[float]
) -> ParameterChange | None:
    """The change of one parameter that explains what a model leaves of records.

    Parameters
    ----------
    model : Model
        Identified before the change.
    records : sequence of Record
        Taken after it, in order.
    used : sequence of int
        Indices of those that count.
    floors : sequence of float
        Floor of every record [m], the error that the model is known to have included.

    Returns
    -------
    ParameterChange or None
        None where nothing changed, or nothing that has a name here.
    """
    search = ChangeSearch(model, records, used, floors)
    given, session = search.account("none", sides=False), search.account("none")
    keys = [k for k, kind in KINDS.items() if k in SHAPES or (kind.rows and kind.rows[0] in search.predicted[0].rows)]
    accounts = sorted((search.best(k) for k in keys), key=lambda a: a.cost)
    best = accounts[0]
    sides = dict(zip(session.names, session.theta.tolist(), strict=False))
    leaves = best.cost < LEAVES or best.cost < NEARLY_ALL * session.cost
    if leaves and best.cost < EXPLAINS * session.cost and session.cost - best.cost > SEEN**2:
        interval = _interval(search, best)
        if _differs(best.size, interval):
            rivals = tuple(a.key for a in accounts[1:] if a.cost < RIVAL * best.cost + 0.02 * session.cost)
            own = dict(zip(best.names, best.theta.tolist(), strict=False))
            beside = {n: own[n] for n in search.sides}
            return ParameterChange(best.key, best.size, interval, rivals, session.cost, best.cost, beside)
    for key, least in (("gain", GAIN), ("loop", LOOP)):
        if (
            abs(sides.get(key, 0.0)) > least
            and given.cost - session.cost > SEEN**2
            and (session.cost < EXPLAINS * given.cost)
        ):
            found = search.best(key) if key in sides else session
            interval = _interval(search, _Account(key, found.cost, sides[key], found.theta, found.names))
            if _differs(sides[key], interval):
                rest = {n: v for n, v in sides.items() if n in search.sides}
                return ParameterChange(key, sides[key], interval, (), given.cost, session.cost, rest)
    return None


def _differs(size: float, interval: tuple[float, float]) -> bool:
    half = 0.5 * (interval[1] - interval[0]) / 1.96
    return abs(size) > SURE * half


def _interval(search: ChangeSearch, best: _Account) -> tuple[float, float]:
    """95 % interval by leaving out groups of pieces."""
    numbers = np.unique(search.labels)
    groups = [g for g in np.array_split(numbers, min(6, numbers.size)) if g.size]
    sizes = []
    for group in groups:
        mask = ~np.isin(search.labels, group)
        if mask.any():
            sizes.append(search.best(best.key, mask, best.size if best.key in SHAPES else None).size)
    count = len(sizes)
    spread = np.sqrt((count - 1.0) / count * np.sum((np.array(sizes) - np.mean(sizes)) ** 2)) if count > 1 else np.inf
    half = 2.2 * float(spread)
    return best.size - half, best.size + half
