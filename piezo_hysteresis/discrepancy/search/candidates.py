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
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np

from ...blocks.block import Array
from ...effects import Arx, Effect, MainsHum, Offset
from ...effects.extent import Extent
from ...errors import DivergenceError, ModelError, ParameterError
from ...identification.cores import on_cores
from ...identification.fit.bounded_step import gauge, room_of
from ...identification.fit.cross_validation import Score, cross_validate, indispensable
from ...identification.fit.fit import Fit
from ...identification.fit.normal_equations import Gram, Linearised, grams
from ...model.model import Model
from .training_data import TrainingData

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


def adjusted_numbers(model: Model, training_data: TrainingData) -> list[str]:
    """Parameters that a joint fit adjusts: all except fixed ones, a whole delay, and those that are free per record.

    A delay of whole samples was found in the response to a step. A fraction of a sample was fitted, and goes on to be.
    `settling` of the offset is not adjusted if all records start at one level, because the data do not determine it.
    """
    values, skipped = model.values(), {f"{MainsHum.name}.f"}
    if float(values.get(f"{Arx.name}.delay", 0.0)).is_integer():
        skipped.add(f"{Arx.name}.delay")
    if training_data.offset:
        skipped.add(f"{Offset.name}.y0")
    if training_data.offset or not training_data.begins_at_levels:
        skipped.add(f"{Offset.name}.settling")
    if loop_is_off(model):  # it stays off
        skipped |= {f"{model.hysteresis.name}.{n}" for n in model.hysteresis.memory_names}
    rows = {n: model.row(n) for n in values if n not in skipped}
    return [n for n, row in rows.items() if not (row.fixed or row.per_record)]


def loop_is_off(model: Model) -> bool:
    """Whether the loop of the model is switched off."""
    return model.has_hysteresis and not model.hysteresis.has_memory


def directions(model: Model, names: Sequence[str], extra: int = 0) -> Array:
    """Columns for `cross_validate`: free parameters at constant G(1), then `extra` rows; none for the residual."""
    free = gauge(model, names)
    columns = np.zeros((len(names) + extra + 1, free.shape[1] + extra))
    columns[: len(names), : free.shape[1]] = free
    columns[len(names) : len(names) + extra, free.shape[1] :] = np.eye(extra)
    return columns


def score_model(model: Model, training_data: TrainingData, known: Linearised | None = None) -> Score:
    """Score of a fitted model on records left out; `known` is what `linearised` would find, if a fit has found it."""
    at = linearised(model, training_data, known)
    return _score(model, at.names, training_data, at.grams, directions(model, at.names))


def score_baseline(fit: Fit, training_data: TrainingData) -> tuple[TrainingData, Score]:
    """The training data and the score. A record that alone determines a parameter of the model is never left out."""
    at = linearised(fit.model, training_data, fit.linearised)
    alone = indispensable(at.grams, training_data.floors, directions(fit.model, at.names))
    training_data = replace(training_data, alone=alone)
    return training_data, score_model(fit.model, training_data, at)


def linearised(model: Model, training_data: TrainingData, known: Linearised | None = None) -> Linearised:
    """The model linearised by the parameters that a joint fit adjusts; `known` itself, if it is by these."""
    names = tuple(adjusted_numbers(model, training_data))
    if known is not None and known.names == names:
        return known
    return Linearised(names, grams(model, training_data.records, names, training_data.free_with(model)))


def _score(
    model: Model, names: Sequence[str], training_data: TrainingData, products: Sequence[Gram], columns: Array
) -> Score:
    room = room_of(model, names, columns)
    return cross_validate(products, training_data.floors, columns, training_data.alone, room)


def screen(model: Model, training_data: TrainingData, effects: Iterable[type[Effect]]) -> list[Candidate]:
    """Score test of every effect of the catalogue at each of its start values, best first.

    Effects that are off at their start share one pass over the data, but for hum, which is free in every record. An
    effect with a finite start is represented by the change that it makes.
    """
    base = adjusted_numbers(model, training_data)
    starts = [
        (effect, starts_of(effect, training_data.extent)) for effect in effects if _fits(model, training_data, effect)
    ]
    groups: list[list[Effect]] = [[s for _, many in starts for s in many if not s.is_off]]
    for turn in range(max((len(s) for _, s in starts), default=0)):
        groups.append([s[turn] for e, s in starts if turn < len(s) and s[turn].is_off and e is not MainsHum])
    groups += [[hum] for effect, s in starts if effect is MainsHum for hum in s]
    best: dict[str, Candidate] = {}
    for _, found in on_cores(partial(_screen_group, model, training_data, base), [g for g in groups if g]):
        for candidate in found:
            if candidate.name not in best or candidate.score.cost < best[candidate.name].score.cost:
                best[candidate.name] = candidate
    return sorted(best.values(), key=BY_COST)


def starts_of(effect: type[Effect], extent: Extent) -> tuple[Effect, ...]:
    """Start values of an effect; none where the ranges of the records are beyond its bounds."""
    try:
        return effect.starts(extent)
    except ParameterError:
        return ()


def _screen_group(model: Model, training_data: TrainingData, base: list[str], group: list[Effect]) -> list[Candidate]:
    """Score test of effects that share one pass over the data."""
    screened = _screen_off if group[0].is_off else _screen_moves
    return screened(model, training_data, base, group)


def _fits(model: Model, training_data: TrainingData, effect: type[Effect]) -> bool:
    has_channel = effect.channel is None or any(effect.channel in r.channels for r in training_data.records)
    return effect.name not in model and has_channel and (effect.host is None or effect.host in model)


def _screen_off(model: Model, training_data: TrainingData, base: list[str], members: list[Effect]) -> list[Candidate]:
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
    now = model.free_run(training_data.records)
    usable, rows = [], []
    for effect in moves:
        with suppress(DivergenceError, ParameterError, ModelError):
            then = model.with_effect(effect).free_run(training_data.records)
            rows.append([a - b for a, b in zip(then, now, strict=True)])
            usable.append(effect)
    if not usable:
        return []
    changes = [np.array(change) for change in zip(*rows, strict=True)]
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
        found.append(Candidate(effect, training_data, _score(model, names, training_data, products, part)))
    return found
