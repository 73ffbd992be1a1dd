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

"""`ChangeSearch`: explanations of the difference between records and the prediction of a given model."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from ..identification.structure.pieces import WEIGHTS, pieces_of
from ..identification.structure.step_weights import shares_of_steps
from ..model.model import Model
from ..record import Record
from .account import DAY_TO_DAY, FARTHEST, PENALTY, Account
from .change_kinds import KINDS
from .signatures import SHAPES, ChangeablePrediction, Shaped, delay_of, predictions

Array = NDArray[np.float64]
Mask = NDArray[np.bool_] | None

SHORTEST, LONGEST = 0.02, 1000.0
"""Range of delays and time constants in the search [samples]."""
SHOWN = 0.3
"""Smallest share of the explained residual that must remain when a part of the records is left out."""
CONSTANT = 1e-9
"""Share of a column that varies within the records up to which it cannot be distinguished from a sensor zero."""
AROUND = 0.2
"""Range of the repeated search without some of the pieces, relative to the size or to one sample."""


class ChangeSearch:
    """Records, their prediction by the model, and explanations of the difference.

    Parameters
    ----------
    model : Model
        The given model.
    records : sequence of Record
        Records in order.
    used : sequence of int
        Indices of the records to explain.
    floors : sequence of float
        Floor of every record, including the known error of the model [m].
    """

    def __init__(self, model: Model, records: Sequence[Record], used: Sequence[int], floors: Sequence[float]) -> None:
        self._records = records
        self.predicted, self.loop_share = predictions(model, records)
        self._earliest = -delay_of(model)
        self.used = list(used)
        self._held: tuple[str, ...] = ()
        self._shapes = SHAPES
        self.sides = ["gain"] + (["loop"] if "loop" in self.predicted[0].rows else [])
        pieces = [p for p in pieces_of(records, self.used) if p.origin in self.used]
        self._kinds = [p.kind for p in pieces]
        self._floors = np.concatenate([np.full(p.record.size, floors[p.origin]) for p in pieces])
        self.labels = np.repeat(np.arange(len(pieces)), [p.record.size for p in pieces])
        root = np.sqrt([WEIGHTS[p.kind] / p.record.size for p in pieces])[self.labels] / self._floors
        self.weights = root / np.sqrt(np.sum((root * self._floors) ** 2))
        self.sizes = [records[i].size for i in self.used]
        self.origins = np.repeat(self.used, self.sizes)
        self.measured = np.concatenate([records[i].displacement for i in self.used])

    def around(self, model: Model) -> ChangeSearch:
        """The same search, with the same weights, around another model."""
        found = copy(self)
        found.predicted, found.loop_share = predictions(model, self._records)
        found._earliest = -delay_of(model)
        return found

    def more_cautious(self, factor: float, held: Sequence[str] = ()) -> ChangeSearch:
        """The same search with floors larger by a factor, where the penalty of `held` has no limit."""
        found = copy(self)
        found.weights, found._floors, found._held = self.weights / factor, self._floors * factor, tuple(held)
        return found

    def with_shape(self, key: str, shape: Shaped) -> ChangeSearch:
        """The same search with one more change that acts on the whole prediction."""
        found = copy(self)
        found._shapes = {**self._shapes, key: shape}
        return found

    def _columns(self, key: str, size: float, names: Sequence[str]) -> tuple[Array, Array]:
        """Changed prediction of all used samples (n,), and the columns `names` with the same change (q, n)."""
        shape, used = self._shapes.get(key), [self.predicted[i] for i in self.used]

        def changed(p: ChangeablePrediction, signal: Array, before: float) -> Array:
            return signal if shape is None else shape(p, signal, before, size)

        y = np.concatenate([changed(p, p.y, p.before) for p in used])
        rows = [y if n == "gain" else np.concatenate([changed(p, p.rows[n], 0.0) for p in used]) for n in names]
        return y, np.array(rows)

    def _weighted(self, signals: Array, root: Array) -> Array:
        """Weighted signals (…, n) without the sensor zero that is fitted in every record."""
        starts, weight = np.cumsum([0, *self.sizes[:-1]]), root**2
        total = np.maximum(np.add.reduceat(weight, starts), np.finfo(np.float64).tiny)
        zeros = np.add.reduceat(weight * signals, starts, axis=-1) / total
        return np.asarray(root * (signals - np.repeat(zeros, self.sizes, axis=-1)))

    def _left(self, account: Account, root: Array) -> Array:
        """Weighted residual that an account leaves (n,), with a zero fitted in every record."""
        y, columns = self._columns(account.key, account.size, account.names)
        return self._weighted(self.measured - y - account.theta @ columns, root)

    def residual(self, account: Account) -> Array:
        """Weighted residual that an account leaves (n,)."""
        return self._left(account, self.weights)

    def directions(self, account: Account, near: float) -> Array:
        """Change of the weighted prediction per unit of a size, and of gain and loop height beside it (1 + sides, n).

        `near` is the step of the difference quotient of the size.
        """
        before, after = (self._left(replace(account, size=account.size + s * near), self.weights) for s in (-1.0, 1.0))
        _, columns = self._columns(account.key, account.size, self.sides)
        return np.vstack(((before - after) / (2.0 * near), self._weighted(columns, self.weights)))

    def account(self, key: str, size: float = 0.0, free: Sequence[str] = (), mask: Mask = None) -> Account:
        """Least squares for the linear parameters and for a zero in every record, with a change of given size."""
        return self.fitted(key, size, free, mask)[0]

    def fitted(self, key: str, size: float = 0.0, free: Sequence[str] = (), mask: Mask = None) -> tuple[Account, Array]:
        """The same account, and the weighted residual that it leaves (n,).

        Gain and loop height have a penalty that corresponds to their change from day to day, unless they are in `free`.
        Beside a change it is at most that of the largest such difference, because they may have changed too.
        """
        names = (*self.sides, *(n for n in (KINDS[key].rows if key in KINDS else ())))
        y, columns = self._columns(key, size, names)
        root = self.weights if mask is None else np.where(mask, self.weights, 0.0)
        target, influence = self._weighted(self.measured - y, root), self._weighted(columns, root)
        scale = np.linalg.norm(influence, axis=1)
        scale[scale <= CONSTANT * np.linalg.norm(root * columns, axis=1)] = np.inf
        matrix = influence / scale[:, None]
        gram, gradient, power = matrix @ matrix.T, matrix @ target, float(target @ target)

        def solved(penalties: Sequence[Array]) -> tuple[float, float, Array]:
            """Cost, remaining V and parameters with quadratic penalties on some directions, a fixed one without any."""
            added = sum((np.outer(row, row) for row in penalties), np.zeros(gram.shape)) / np.outer(scale, scale)
            found = np.linalg.lstsq(gram + added, gradient, rcond=1e-12)[0]
            left = float(power - 2.0 * gradient @ found + found @ gram @ found)
            moved = PENALTY * FARTHEST**2 * sum(not row.any() for row in penalties)
            return left + float(found @ added @ found) + moved, left, found / scale

        held = [self._penalties(key, name, names) for name in self.sides if name not in free]
        cost, left, theta = min(map(solved, itertools.product(*held)), key=lambda found: found[0])
        return Account(key, cost, left, size, theta, names, scale), target - theta @ influence

    def _penalties(self, key: str, name: str, names: Sequence[str]) -> list[Array]:
        """Directions of the parameters `names` along which gain or loop height may have a penalty; zeros for none.

        A changed loop height comes with the same mean slope, or with the same parameters beside it.
        """
        row = np.zeros(len(names))
        row[names.index(name)] = PENALTY**0.5 / DAY_TO_DAY[name]
        rows = [row]
        if name == "gain" and key == "loop":
            other = row.copy()
            other[names.index("loop")] = -self.loop_share * row[names.index("gain")]
            rows.append(other)
        return rows if key == "none" or name in self._held else [*rows, np.zeros(len(names))]

    def discount_steps(self, account: Account) -> None:
        """Give a step that the account describes worse than all other motion less weight."""
        left = self._left(account, self.weights)
        cost, weight = (np.bincount(self.labels, s**2).astype(np.float64) for s in (left, self.weights * self._floors))
        squares = cost / np.maximum(weight, np.finfo(np.float64).tiny)
        self.weights = self.weights * np.sqrt(shares_of_steps(self._kinds, squares, weight))[self.labels]

    def session(self, account: Account) -> dict[str, float]:
        """Relative changes of gain and loop height in an account."""
        numbers = {n: account.own[n] for n in self.sides}
        numbers["gain"] -= self.loop_share * numbers.get("loop", 0.0)
        return numbers

    def stated(self, name: str, change: float) -> float:
        """A change of gain or loop height as a relative change of the mean slope, or of the loop at the same slope.

        The branches of a loop that is larger by x also rise more, by its share of the slope.
        """
        return change if name != "loop" else change * (1.0 - self.loop_share) / (1.0 + self.loop_share * change)

    def of_equal_records(self, account: Account, floors: Sequence[float]) -> float:
        """V that an account without change leaves, with equal weights of the records; `floors` of all records [m].

        A model states its error with these weights.
        """
        left = self._left(account, np.ones(self.measured.size))
        power = np.add.reduceat(left**2, np.cumsum([0, *self.sizes[:-1]])) / self.sizes
        return float(np.mean(power) / np.mean([floors[i] ** 2 for i in self.used]))

    def shaped(self, key: str, mask: Mask = None, near: float | None = None, free: Sequence[str] = ()) -> Account:
        """The best size of a delay, which cannot be earlier than a model without dead time, or of a filter."""
        period = min(p.record.sample_period for p in self.predicted)
        if near is None:
            sizes = period * np.geomspace(SHORTEST, LONGEST, 20)
            if key == "delay":
                sizes = np.array([s for s in (*-sizes[9::-1], *sizes) if s >= self._earliest])
            near = float(min(sizes, key=lambda s: self.account(key, float(s), free, mask).cost))
            low, high = sorted((0.4 * near, 2.2 * near))
        else:
            half = max(AROUND * abs(near), AROUND * period)
            low, high = near - half, near + half
        low = max(low, self._earliest) if key == "delay" else low
        found = scipy.optimize.minimize_scalar(
            lambda s: self.account(key, float(s), free, mask).cost,
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-3 * max(abs(near), SHORTEST * period)},
        )
        return self.account(key, float(found.x), free, mask)

    def best(self, key: str, mask: Mask = None, near: float | None = None) -> Account:
        """The account of a change with its best size, in the unit of its kind."""
        if key in self._shapes:
            return self.shaped(key, mask, near)
        found = self.account(key, free=(key,), mask=mask)
        rows = KINDS[key].rows or (key,)
        return replace(found, size=sum(found.own[r] for r in rows))

    def halves(self, best: Account) -> Array:
        """Half 95 % jackknife intervals of the size, of gain and of loop height.

        Groups of pieces or records are left out, and the wider one counts. A part without which little of the change
        remains is not used, nor for gain and loop height what hardly shows them: they would be those of the prior.
        """
        numbers = np.unique(self.labels[self.weights > 0.0])
        groups = [g for g in np.array_split(numbers, min(6, numbers.size)) if g.size]
        near = best.size if best.key in self._shapes else None
        whole = self.account("none").cost - best.cost
        half = np.zeros(1 + len(self.sides))
        for labels, parts in ((self.labels, groups), (self.origins, [[o] for o in np.unique(self.origins)])):
            masks = [~np.isin(labels, part) for part in parts]
            found = [(self.account("none", mask=m).cost, self.best(best.key, m, near)) for m in masks if m.any()]
            kept = [rest for without, rest in found if without - rest.cost > SHOWN * whole]
            sizes = [[rest.size for rest in kept]]
            for at, name in enumerate(self.sides):  # the first parameters of every account
                least = SHOWN**0.5 * best.scale[at]
                sizes.append([rest.own[name] for rest in kept if least < rest.scale[at] < np.inf])
            for k, values in enumerate(sizes):
                if (count := len(values)) > 1:
                    spread = (count - 1) * float(scipy.stats.sem(values))
                    half[k] = max(half[k], float(scipy.stats.t.ppf(0.975, count - 1)) * spread)
        return np.where(half > 0.0, half, np.inf)
