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

"""The gap: free-run error before and after effects are added, on records used neither to fit nor to choose."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from ..blocks.block import Array
from ..effects import MainsHum
from ..errors import DivergenceError
from ..identification.fit.normal_equations import Nuisance
from ..identification.free_run_error import free_per_record, residuals_on
from ..identification.records.excitation_check import moves
from ..identification.records.noise_floor import ADEQUATE
from ..model.model import Model
from ..model.provenance import with_origin
from ..record import Experiment, Record
from .search.baseline_setup import BaselineSetup
from .search.selection_result import explained

FALLS = 0.9
"""Largest ratio of V after to V before, on the test records, with which an effect is named."""


@dataclass(frozen=True, slots=True)
class PhaseGap:
    """Gap of one record, RMS in % of range."""

    phase: str
    index: int
    before: float
    after: float
    floor: float


@dataclass(frozen=True, slots=True)
class Gap:
    """RMS over records with equal weights, in % of the range of the experiment.

    Parameters
    ----------
    before, after, floor : float
        Error of the baseline, error of the extended model, and noise floor [% of range].
    interval_95 : (float, float) or None
        95 % interval of `after` (Student's t), with records as independent units [% of range]; None for one record.
    per_phase : tuple of PhaseGap
        Gap of every record.
    unseen : bool
        True if none of the records was used for fitting or choosing; False if there were too few records for this.
    live : float
        Expected error of the extended model in live prediction [% of range]: without the numbers that are fitted to
        each record. It differs from `after` only for effects that are not predicted live.
    free_zeros : bool
        Whether the sensor zero was free in every record.
    refitted : Gap or None
        The gap from the given model, fitted to these records without the effects, to the extended model. A fit also
        removes what has changed in the stage, and this is no share of the effects. None without a given model.
    """

    before: float
    after: float
    floor: float
    interval_95: tuple[float, float] | None
    per_phase: tuple[PhaseGap, ...]
    unseen: bool
    live: float
    free_zeros: bool = False
    refitted: Gap | None = None

    @property
    def falls(self) -> bool:
        """Whether the extended model is better, with every record in units of its own floor.

        Records with little noise, which show effects that the other records do not, then have the same weight. If there
        is no gap before, any improvement is sufficient.
        """
        before, after = self._squares
        return after < (FALLS if before > ADEQUATE else 1.0) * before

    @property
    def explained(self) -> float:
        """Share X of the gap that the extended model explains: 1 − √((V_after − 1)/(V_before − 1)), between 0 and 1."""
        return explained(*self._squares, 1.0)

    @property
    def explained_by_effects(self) -> float:
        """The same share of what the model leaves if it is fitted to these records without the effects."""
        return (self.refitted or self).explained

    def stated_by(self, model: Model, experiment: Experiment, setup: BaselineSetup | None = None) -> Model:
        """The extended model with the experiment as its origin, and with its errors.

        The errors are those on all records of `setup` that are compared with a model; without it, or if the model
        diverges on one of them, those of the gap.
        """
        rows = self.per_phase
        if setup is not None and len(rows) < len(setup.usable):
            with suppress(DivergenceError):
                rows = gap_between(model, model, setup, setup.usable, offset=self.free_zeros).per_phase
        after, moving = [p.after for p in rows], [p.after for p in rows if moves(experiment[p.index])]
        percent = max(after), float(np.sqrt(np.mean(np.square(moving or after))))
        largest, mean = (0.01 * experiment.range * max(error, self.live) for error in percent)
        return with_origin(model, experiment, self.live, largest, mean, self.unseen)

    @property
    def _squares(self) -> tuple[float, float]:
        """V before and after: mean over the records of the squared error, in floors."""
        before, after = ([(getattr(p, when) / p.floor) ** 2 for p in self.per_phase] for when in ("before", "after"))
        return float(np.mean(before)), float(np.mean(after))


def gap_answer(gap: Gap | None) -> dict[str, Any]:
    """The gap as in ``answer.json``, in % of range; without values if there is none."""
    if gap is None:
        unknown = ("before", "after", "live", "floor", "after_interval_95")
        return dict.fromkeys(unknown) | {"unseen": False, "per_phase": {}}
    return {
        "before": gap.before,
        "after": gap.after,
        "live": gap.live,
        "floor": gap.floor,
        "after_interval_95": None if gap.interval_95 is None else list(gap.interval_95),
        "unseen": gap.unseen,
        "per_phase": {
            f"{p.index:02d}_{p.phase}": {"before": p.before, "after": p.after, "floor": p.floor} for p in gap.per_phase
        },
    }


def measure_gap(
    models: tuple[Model, Model],
    records: Sequence[Record],
    chosen: Sequence[int],
    floors: Sequence[float] | Array,
    stroke: float,
    *,
    unseen: bool,
    offset: bool = False,
) -> Gap:
    """Compare two models on the records `chosen`.

    Parameters
    ----------
    models : (Model, Model)
        Baseline and extended model.
    records : sequence of Record
        The whole experiment, so that the state continues from record to record.
    chosen : sequence of int
        Indices of the records on which the gap is measured.
    floors : sequence of float
        Floor of every record [m].
    stroke : float
        Range of the experiment [m].
    unseen : bool
        Whether the chosen records were used neither for fitting nor for choosing.
    offset : bool
        Whether the sensor zero is free in every record. The hum of a model with hum always is.

    Raises
    ------
    DivergenceError
        If a model diverges on one of the chosen records, or on one that it continues.
    """

    def left_by(model: Model, nuisance: Nuisance | None = None) -> Array:
        left = residuals_on(model, records, chosen, nuisance or free_per_record(model, offset=offset))
        return np.array([100.0 * float(np.sqrt(np.mean(e**2))) / stroke for e in left])

    least = 100.0 * np.array([floors[i] for i in chosen]) / stroke
    before = left_by(models[0])
    after = before if models[1] is models[0] else left_by(models[1])
    live = left_by(models[1], Nuisance(offset)) if MainsHum.name in models[1] else after
    squares = after**2
    mean, interval = float(squares.mean()), None
    if squares.size > 1:
        spread = float(scipy.stats.t.ppf(0.975, squares.size - 1) * scipy.stats.sem(squares))
        interval = float(np.sqrt(max(0.0, mean - spread))), float(np.sqrt(mean + spread))
    return Gap(
        before=float(np.sqrt(np.mean(before**2))),
        after=float(np.sqrt(mean)),
        floor=float(np.sqrt(np.mean(least**2))),
        interval_95=interval,
        per_phase=tuple(
            PhaseGap(records[i].phase, i, float(b), float(a), float(f))
            for i, b, a, f in zip(chosen, before, after, least, strict=True)
        ),
        unseen=unseen,
        live=float(np.sqrt(np.mean(np.square(live)))),
        free_zeros=offset,
    )


def gap_between(
    before: Model, after: Model, setup: BaselineSetup, chosen: Sequence[int], *, offset: bool = False
) -> Gap:
    """`measure_gap` on the records `chosen` of a search; only its test records are unseen."""
    unseen = set(chosen) <= set(setup.test_records)
    return measure_gap((before, after), setup.records, chosen, setup.least, setup.span, unseen=unseen, offset=offset)
