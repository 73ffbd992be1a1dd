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

"""`BaselineSetup`: records with their floors, split and shortened, and the baseline fitted to them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.block import Array
from ...effects.extent import Extent
from ...errors import DivergenceError
from ...identification.cores import start_helpers
from ...identification.fit.cross_validation import Score
from ...identification.fit.fit import Fit, Progress
from ...identification.fit.form_uncertainty import ADEQUACY
from ...identification.records.conditioning import path_of, with_conditioning
from ...identification.records.intersample_error import intersample_error
from ...identification.records.noise_floor import ADEQUATE, noise_floors, noise_of_averages, stroke
from ...identification.records.sampling import at_period, common_period, less, shortened, slowed
from ...identification.start_models import exact, modal_models, start_models
from ...identification.training.joint_fit import FAILURES, LAST, LATER, PRECISE, joint
from ...identification.training.model_score import score_baseline, score_model, scored
from ...identification.training.training_data import TrainingData, choose_test_records
from ...model.model import Model
from ...record import Record
from .candidate_refits import leaves_room
from .selection_result import Selection

SEARCHED, FITTED = 6_000, 50_000
"""Largest number of samples of a record, approximately, in the search and in the last fit."""
CLEARLY = 0.7
"""Largest ratio of V with a sum of modes to V before: a small improvement may only be another way of absorbing the
missing effect."""
UNSURE = 0.3
"""Share of the inter-sample error that is added to the floor; the correction removes the rest."""


@dataclass(frozen=True, eq=False, slots=True)
class BaselineSetup:
    """The starting point of a search for effects.

    All records, `given` and `records`, are at the period of the dynamics or slower, without and with the correction of
    the inter-sample error `lost` [m]. `noise` and `least` are their noise and floor [m]; those of the `training_data`,
    which are the `fitted` records shortened, are lower where these are averages. `span` is the displacement range [m].
    """

    given: tuple[Record, ...]
    records: tuple[Record, ...]
    lost: list[Array]
    noise: Array
    least: Array
    span: float
    usable: Sequence[int]
    fitted: Sequence[int]
    test_records: Sequence[int]
    training_data: TrainingData
    baseline: Fit
    score: Score

    @property
    def tested(self) -> Sequence[int]:
        """Indices of the records on which the gap is measured: the fitted ones if there are no test records."""
        return self.test_records or self.fitted

    def for_last_fit(self) -> tuple[TrainingData, Array]:
        """The training data, averaged or cut to about `FITTED` samples only where records are longer, and its noise."""
        records, least, noise = _short(self.records, self.noise, self.lost, self.span, self.fitted, FITTED)
        return replace(self.training_data, records=records, floors=least, noise=noise), noise

    def changes_intersample_error(self, model: Model) -> bool:
        """Whether the inter-sample error computed with this model differs by more than the floor of a record."""
        try:
            again = intersample_error(model, self.given)
        except DivergenceError:  # on a test record, which moves further than those that were fitted
            return False
        return any(np.std(a - b) > f for a, b, f in zip(again, self.lost, self.least, strict=True))


def prepare_baseline(
    given: Sequence[Record],
    usable: Sequence[int],
    model: Model | None,
    known: Selection | None,
    corrects_intersample_error: bool,
    progress: Progress,
) -> BaselineSetup:
    """Floors, records to fit and to set aside, and the baseline.

    The fit begins with `model`, or with one from the `usable` records, given by their indices. `known` is an earlier
    search, whose model corrects averaged samples better than the baseline does.
    """
    progress("baseline", 0.1)
    records = tuple(slowed(r) for r in given)
    test_records = choose_test_records(records, usable)
    fitted = [i for i in usable if i not in test_records]
    noise, span = noise_floors(records), stroke(records)
    at_full_rate = [r for r, g in zip(records, given, strict=True) if r.sample_period == g.sample_period]
    period = model.sample_period if model is not None else common_period(at_full_rate or records)
    straight = tuple(at_period(r, period) if i in usable else r for i, r in enumerate(records))
    noise, records = noise_of_averages(noise, records, straight), straight
    first = known.baseline if known is not None else model
    starts = iter((first,)) if first is not None else start_models(records, fitted)
    start = exact(next(starts))
    extent = Extent.of([records[i] for i in usable], start.voltage_scale, start.displacement_scale)
    unfitted = start if known is None or known.training_data is None else known.training_data.start

    def gathered(records: Sequence[Record], lost: Sequence[Array]) -> TrainingData:
        kept, least, quiet = _short(records, noise, lost, span, fitted, SEARCHED)
        return TrainingData(kept, least, extent, start=unfitted, noise=quiet)

    lost = [np.zeros(r.size) for r in records]
    training_data = gathered(records, lost)
    progress("joint fit of the baseline", 0.2)
    baseline = joint(start, training_data, LAST)
    if corrects_intersample_error:
        with suppress(DivergenceError):  # on a test record, which moves further than those that were fitted
            lost = intersample_error(known.model if known is not None else baseline.model, records)
    begun = baseline.linearised
    if any(c.any() for c in lost):
        records = less(records, lost)
        training_data, begun = gathered(records, lost), None
    progress("joint fit of the baseline", 0.3)
    baseline = joint(baseline.model, training_data, LATER, PRECISE, begun)
    training_data, score = score_baseline(baseline, training_data)
    if leaves_room(score):
        start_helpers()  # effects will be searched for
    if score.excess > ADEQUATE:
        for other in starts:
            baseline, score = better_fit(exact(other), baseline, score, training_data)
    if score.excess > ADEQUATE:
        for modal in modal_models(baseline.model, records, fitted):
            baseline, score = better_fit(modal, baseline, score, training_data, CLEARLY)
    least = _floors(noise, span, lost)
    return BaselineSetup(
        straight, records, lost, noise, least, span, usable, fitted, test_records, training_data, baseline, score
    )


def _floors(noise: Array, span: float, lost: Sequence[Array]) -> Array:
    """Floors of records with this noise, and with a part of their inter-sample error [m]."""
    return np.hypot(np.maximum(noise, ADEQUACY * span), [UNSURE * np.sqrt(np.mean(c**2)) for c in lost])


def _short(
    records: Sequence[Record], noise: Array, lost: Sequence[Array], span: float, fitted: Collection[int], most: int
) -> tuple[tuple[Record, ...], Array, Array]:
    """Training records with about `most` samples, their floors and their noise [m].

    A record that only determines the state of the next one becomes a path.
    """
    short = shortened(records, most)
    noise = noise_of_averages(noise, records, short)
    least = _floors(noise, span, lost)
    parts = [
        (part, least[i], noise[i]) if i in fitted else (part, np.inf, np.inf)
        for i in with_conditioning(short, fitted)
        for part in ((short[i],) if i in fitted else path_of(short[i], most))
    ]
    return tuple(p for p, _, _ in parts), np.array([f for _, f, _ in parts]), np.array([n for _, _, n in parts])


def better_fit(
    start: Model, found: Fit, score: Score, training_data: TrainingData, share: float = np.inf
) -> tuple[Fit, Score]:
    """A fit and its score, or those from another start if the fit is better.

    Cross-validation judges the start first, after one linear step, by C, or by V if only a `share` of V may remain
    after the fit. A start that is not better then, or from which the fit fails, is left out.
    """
    with suppress(*FAILURES):
        first = scored(start, training_data)
        if first.score.cost < score.cost if np.isinf(share) else first.score.excess < score.excess:
            other = joint(start, training_data, LAST, known=first.linearised)
            if other.cost < found.cost:
                other = joint(other.model, training_data, LATER, PRECISE, other.linearised)
                after = score_model(other.model, training_data, other.linearised)
                if after.excess < share * score.excess:
                    return other, after
    return found, score
