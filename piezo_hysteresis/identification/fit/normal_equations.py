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

"""Inner products of residual, sensitivities and disturbances of every record, for fits and score tests.

The matrices are small; records of any length are summed block by block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...effects.environment.mains_hum import harmonics
from ...errors import DivergenceError
from ...model.model import Model
from ...record import Record
from .inner_products import inner_products

Array = NDArray[np.float64]

RUNAWAY = 1e100
"""Inner products above this value mean that the simulation diverges."""


@dataclass(frozen=True, slots=True)
class Nuisance:
    """Linear disturbances that are free in every record and are eliminated exactly.

    Parameters
    ----------
    offset : bool
        Whether the sensor zero is free in every record.
    hum_frequency : float, optional
        Mains frequency [Hz]; amplitude and phase of the hum are free in every record.
    harmonics : int
        Number of harmonics of the hum.
    """

    offset: bool = False
    hum_frequency: float | None = None
    harmonics: int = 3

    def rows(self, record: Record, part: slice) -> Array:
        """Basis functions, shape (k, n)."""
        size = part.stop - part.start
        rows = [np.ones(size)] if self.offset else []
        if self.hum_frequency is not None:
            t = record.sample_period * np.arange(part.start, part.stop)
            waves = zip(*harmonics(self.hum_frequency, self.harmonics, t), strict=True)
            for order, (cosine, sine) in enumerate(waves, 1):
                line = order * self.hum_frequency * record.sample_period
                # a line that aliases to dc averages to zero, and would free the offset
                if abs(line - round(line)) * record.size > 1.0:
                    rows += [cosine, sine]
        return np.array(rows).reshape(len(rows), size)

    def removed_from(self, residual: Array, record: Record) -> Array:
        """The residual of a record without these disturbances, shape (n,) [m]."""
        if self.hum_frequency is None:
            return residual - residual.mean() if self.offset else residual
        rows = self.rows(record, slice(0, record.size))
        return np.asarray(residual - np.linalg.lstsq(rows @ rows.T, rows @ residual, rcond=None)[0] @ rows)


@dataclass(frozen=True, eq=False, slots=True)
class Gram:
    """Inner products of one record after elimination of its disturbances.

    Parameters
    ----------
    size : int
        Number of samples.
    matrix : (q + k + 1, q + k + 1) ndarray
        Inner products of the q sensitivities in the requested order, of k extra rows, and of the residual (last).
    nuisance : (k,) ndarray
        Amplitudes of the disturbances at the present parameters.
    """

    size: int
    matrix: Array
    nuisance: Array

    @property
    def rms(self) -> float:
        """RMS residual [m]."""
        return float(np.sqrt(max(self.matrix[-1, -1], 0.0) / self.size))


@dataclass(frozen=True, eq=False, slots=True)
class Linearised:
    """A model linearised at its values.

    Parameters
    ----------
    names : tuple of str
        Parameters of the sensitivities.
    grams : sequence of Gram
        Inner products of every record.
    nuisance : Nuisance
        Disturbances that were eliminated.
    """

    names: tuple[str, ...]
    grams: Sequence[Gram]
    nuisance: Nuisance = Nuisance()


def grams(
    model: Model,
    records: Sequence[Record],
    wanted: Sequence[str] = (),
    nuisance: Nuisance | None = None,
    extra: Sequence[Array] | None = None,
) -> list[Gram]:
    """Inner products for every record.

    Parameters
    ----------
    model : Model
        Model that is simulated in free run.
    records : sequence of Record
        Records in experiment order, so that the state continues.
    wanted : sequence of str
        Parameters whose sensitivities are computed, e.g. ``"creep.gamma"``.
    nuisance : Nuisance, optional
        Disturbances that are eliminated in every record.
    extra : sequence of (k, n) ndarray, optional
        Further rows of every record, e.g. finite changes of the simulation.

    Raises
    ------
    DivergenceError
        If the output or a sensitivity diverges.
    """
    nuisance = nuisance or Nuisance()
    q = len(wanted) + (len(extra[0]) if extra else 0)
    sums: list[Array] = []
    for index, part, y, names, slopes in model.linearise(records, wanted):
        record = records[index]
        beside = [(record.displacement[part] - y)[None, :], nuisance.rows(record, part)]
        others: Array = np.concatenate([extra[index][:, part], *beside] if extra else beside)
        order = np.array([names.index(name) for name in wanted], np.intp)
        product = inner_products(slopes, order, others)
        if not product.diagonal().max() < RUNAWAY:
            raise DivergenceError(model.effects[-1].name, part.start, part.start * record.sample_period)
        if index == len(sums):
            sums.append(product)
        else:
            sums[index] += product
    result = []
    for record, lower in zip(records, sums, strict=True):
        total = np.tril(lower) + np.tril(lower, -1).T
        inner, cross, free = total[: q + 1, : q + 1], total[q + 1 :, : q + 1], total[q + 1 :, q + 1 :]
        amplitudes: Array = np.linalg.lstsq(free, cross, rcond=None)[0].astype(np.float64) if len(free) else cross
        result.append(Gram(record.size, inner - cross.T @ amplitudes, amplitudes[:, -1].copy()))
    return result


def linearised_by(
    model: Model,
    records: Sequence[Record],
    names: Sequence[str],
    nuisance: Nuisance | None = None,
    known: Linearised | None = None,
) -> Linearised:
    """The model linearised by the parameters `names`; `known` itself, if it is by these beside these disturbances."""
    names, nuisance = tuple(names), nuisance or Nuisance()
    if known is not None and (known.names, known.nuisance) == (names, nuisance):
        return known
    return Linearised(names, grams(model, records, names, nuisance), nuisance)


def residuals(model: Model, records: Sequence[Record], nuisance: Nuisance | None = None) -> list[Array]:
    """Measured minus free-run displacement of every record [m], without the disturbances."""
    nuisance = nuisance or Nuisance()
    pairs = zip(records, model.free_run(records), strict=True)
    return [nuisance.removed_from(record.displacement - y, record) for record, y in pairs]
