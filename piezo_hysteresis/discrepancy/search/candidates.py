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

"""Candidates for the missing effect: a projected score test of the whole catalogue.

An effect is only visible in the residual as far as the present model cannot imitate it. Residual and sensitivities are
therefore projected orthogonally to all free parameters of the model. The inner products of
`identification.normal_equations` do this for all effects at once. The score is computed on records left out of the fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

import numpy as np

from ...blocks.block import Array
from ...effects import Effect, MainsHum
from ...effects.extent import Extent
from ...errors import DivergenceError, ModelError, ParameterError
from ...identification.cores import on_cores
from ...identification.fit.cross_validation import Score
from ...identification.fit.fit import Fit
from ...identification.fit.normal_equations import Gram, grams
from ...identification.training.adjusted_numbers import adjusted_numbers, directions
from ...identification.training.model_score import score_of
from ...identification.training.training_data import TrainingData
from ...model.model import Model

BY_COST = attrgetter("score.cost")
"""Key that sorts candidates and fitted models, the best one first."""


@dataclass(frozen=True, eq=False, slots=True)
class Candidate:
    """An effect after the score test: its start values, and its score on records left out.

    Parameters
    ----------
    effect : Effect
        The effect with its start values, or with fitted values after a refit.
    training_data : TrainingData
        Records for fitting and choosing.
    score : Score
        Score from a linearisation at the start values, or after the refit.
    """

    effect: Effect
    training_data: TrainingData
    score: Score

    @property
    def name(self) -> str:
        """Identifier of the effect."""
        return self.effect.name


@dataclass(frozen=True, eq=False, slots=True)
class FittedCandidate(Candidate):
    """A candidate that was fitted jointly with the whole model."""

    fit: Fit


def screen(
    model: Model, training_data: TrainingData, effects: Iterable[type[Effect]], is_small: bool = False
) -> list[Candidate]:
    """Score test of every effect of the catalogue at each of its start values, best first.

    Effects that are off at their start share one pass over the data, but for hum, which is free in every record. An
    effect with a finite start is represented by the change that it makes. Where what remains is small (`is_small`), a
    term of the loop or of the dynamics that can start from off needs no other start; the dynamics cannot hide it.
    """
    base = adjusted_numbers(model, training_data)
    starts = [
        (effect, starts_of(effect, training_data.extent)) for effect in effects if _fits(model, training_data, effect)
    ]
    finite = [many for e, many in starts if not (is_small and e.host and any(s.is_off for s in many))]
    groups: list[list[Effect]] = [[s for many in finite for s in many if not s.is_off]]
    for turn in range(max((len(s) for _, s in starts), default=0)):
        groups.append([s[turn] for e, s in starts if turn < len(s) and s[turn].is_off and e is not MainsHum])
    groups += [[hum] for effect, s in starts if effect is MainsHum for hum in s]
    passes = on_cores(partial(_screen_group, model, training_data, base), [g for g in groups if g])
    found = sorted((candidate for _, many in passes for candidate in many), key=BY_COST)
    return sorted({candidate.name: candidate for candidate in reversed(found)}.values(), key=BY_COST)


def starts_of(effect: type[Effect], extent: Extent) -> tuple[Effect, ...]:
    """Start values of an effect; none where the ranges of the records are beyond its bounds."""
    try:
        return effect.starts(extent)
    except ParameterError:
        return ()


def _fits(model: Model, training_data: TrainingData, effect: type[Effect]) -> bool:
    has_channel = effect.channel is None or any(effect.channel in r.channels for r in training_data.records)
    return effect.name not in model and has_channel and (effect.host is None or effect.host in model)


def _screen_group(model: Model, training_data: TrainingData, base: list[str], members: list[Effect]) -> list[Candidate]:
    """Score test of effects that share one pass over the data."""
    if not members[0].is_off:
        return _screen_moves(model, training_data, base, members)
    extended = model
    for effect in list(members):
        try:
            trial = extended.with_effect(effect)
            trial.at(model.sample_period)
            extended = trial
        except ModelError:
            members = [m for m in members if m is not effect]
    adjusted = adjusted_numbers(extended, training_data)
    own = [[n for n in adjusted if n.startswith(f"{e.name}.")] for e in members]
    names = [*base, *(n for added in own for n in added)]
    products = grams(extended, training_data.records, names, training_data.free_with(extended))
    columns = directions(model, base, len(names) - len(base))
    return _scored(extended, names, training_data, products, columns, zip(members, map(len, own), strict=True))


def _screen_moves(model: Model, training_data: TrainingData, base: list[str], moves: list[Effect]) -> list[Candidate]:
    now, usable = model.free_run(training_data.records), list[Effect]()
    changes = [np.empty((len(moves), y.size)) for y in now]
    for effect in moves:
        with suppress(DivergenceError, ParameterError, ModelError):
            then = model.with_effect(effect).free_run(training_data.records)
            for change, a, b in zip(changes, then, now, strict=True):
                np.subtract(a, b, out=change[len(usable)])
            usable.append(effect)
    changes = [change[: len(usable)] for change in changes]
    products = grams(model, training_data.records, base, training_data.free_with(model), changes)
    columns = directions(model, base, len(usable))
    found = _scored(model, base, training_data, products, columns, ((e, 1) for e in usable))
    # with a negative step, the effect with opposite sign would improve the prediction
    return [c for c in found if c.score.step[-1] > 0.0]


def _scored(
    model: Model,
    names: Sequence[str],
    training_data: TrainingData,
    products: list[Gram],
    columns: Array,
    added: Iterable[tuple[Effect, int]],
) -> list[Candidate]:
    """Effects with their scores; each has the given number of the last columns, in order."""
    sizes = list(added)
    kept = first = columns.shape[1] - sum(size for _, size in sizes)
    found = []
    for effect, size in sizes:
        part = columns[:, [*range(kept), *range(first, first + size)]]
        first += size
        found.append(Candidate(effect, training_data, score_of(model, names, training_data, products, part)))
    return found
