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

"""`refit_candidates`: joint refits of candidates, with more iterations for the better ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ...effects import AmplifierSaturation, Creep, ThermalDrift
from ...effects.effect import ChainPosition
from ...identification.fit.cross_validation import Score
from ...identification.fit.fit import Progress
from ...identification.fit.form_uncertainty import LAG
from ...identification.records.noise_floor import ADEQUATE
from ...identification.structure.prior import CREEP
from ...identification.training.joint_fit import FIRST, LATER
from ...model.model import Model
from .candidates import BY_COST, Candidate, FittedCandidate
from .refit import collected, from_all_starts, proceed, refit, refit_anew, restart

LEAST_GAIN = 0.15
"""Smallest gain in mean ln max(1, R²) for which an effect is accepted."""
CLOSE = 0.3
"""Largest lag of a rival behind the best candidate, as a share of the best gain."""
AGAIN = 3
"""Number of refits that are repeated with newly estimated dynamics."""
WORTHWHILE = 0.8
"""Ratio of the new to the old cost above which a refit is not repeated."""
REST = 0.06
"""Largest V with another law, as a share of V with the first one: three quarters of the RMS error are explained."""
TIE = 0.02
"""Difference in gain up to which the form and the effect with the fewest parameters are taken."""


def leaves_room(score: Score) -> bool:
    """Whether the error is above its floor, or so large in some records that an effect could gain enough."""
    return score.excess > ADEQUATE or score.cost > LEAST_GAIN


def refit_candidates(
    model: Model, candidates: Sequence[Candidate], before: Score, progress: Progress
) -> list[FittedCandidate]:
    """Joint refits, best first: few linearisations for all, then new dynamics, then convergence for the best ones."""
    progress("refits of the candidates", 0.2)
    first = partial(refit, model, max_iterations=FIRST)

    def is_wanted(candidate: Candidate, found: Sequence[FittedCandidate]) -> bool:
        """Beside a refit at the floor, only a rival of it is."""
        return all(_is_close(candidate, other, before) for other in found if other.score.excess <= ADEQUATE)

    refits = collected(first, candidates, is_wanted)
    refits.sort(key=BY_COST)
    progress("new estimate of the dynamics", 0.6)

    def is_rival(candidate: FittedCandidate, found: Sequence[FittedCandidate]) -> bool:
        return not found or _is_close(candidate, found[0], before)

    anew = collected(_anew, refits[:AGAIN], is_rival)
    field = _replaced(refits, anew)
    progress("refits of the best candidates", 0.8)
    return _replaced(field, collected(partial(settled, before=before), field, is_rival))


def _replaced(before: list[FittedCandidate], after: list[FittedCandidate]) -> list[FittedCandidate]:
    """The refits before, with those of the same effects after, best first."""
    names = {c.name for c in after}
    return sorted([*after, *(c for c in before if c.name not in names)], key=BY_COST)


def refits_behind_new_dynamics(model: Model, candidates: Sequence[Candidate], before: Score) -> list[FittedCandidate]:
    """Refits of effects of the drive and the loop that the dynamics have absorbed, so that no score test shows them.

    They act before the dynamics, which can imitate them, so that the cost has several minima. At the floor, what
    remains is small, and the dynamics absorb only a lag.
    """
    before_dynamics = [c for c in candidates if c.effect.place is ChainPosition.DRIVE or c.effect.host is not None]
    bending = [c for c in before_dynamics if before.excess > ADEQUATE or c.effect.family == LAG]
    return collected(partial(settled, before=before), collected(partial(from_all_starts, model), bending))


def refits_of_creep(model: Model, candidates: Sequence[Candidate], best: FittedCandidate) -> list[FittedCandidate]:
    """Refits of creep of a usual size behind new dynamics, if creep or a drift is best.

    Slow poles of the dynamics can contain creep but for its slowest part, which a drift or a relaxation describes.
    """
    if best.effect.family not in (Creep.family, ThermalDrift.family):
        return []
    usual = [replace(c, effect=c.effect.with_values(gamma=CREEP)) for c in candidates if c.name == Creep.name]
    return collected(partial(refit_anew, model), usual)


def refits_of_relatives(candidates: Sequence[Candidate], best: FittedCandidate, before: Score) -> list[FittedCandidate]:
    """Refits of candidates that are equal to the best one on slow drives, and of its other laws if an error remains.

    Each refit begins with the fitted model of the best one, because the loop is the same. Another law has to reach the
    floor: it could absorb a part of a further effect that is missing.
    """
    law = best.effect.public_name() if leaves_room(best.score) else None
    twins = [c for c in candidates if c.effect.is_twin_of(best.effect)]
    laws = [c for c in candidates if c.effect.public_name() == law and c.name != best.name]
    from_best = partial(refit, best.fit.model.without(best.name), max_iterations=LATER)
    found = collected(partial(settled, before=before), collected(from_best, [*twins, *laws]))
    names = {c.name for c in twins}
    return [c for c in found if c.name in names or c.score.excess <= ADEQUATE]


def _anew(candidate: FittedCandidate) -> FittedCandidate:
    """The refit with newly estimated dynamics, if a further gain is possible."""
    return candidate if candidate.score.cost <= LEAST_GAIN else restart(candidate, FIRST)


def _is_close(candidate: Candidate, best: FittedCandidate, before: Score) -> bool:
    """Whether a candidate is a rival of the best one."""
    return candidate.score.cost < best.score.cost + CLOSE * max(before.cost - best.score.cost, LEAST_GAIN)


def settled(candidate: FittedCandidate, before: Score) -> FittedCandidate:
    """The converged refit, repeated with new dynamics while this removes much of the remaining cost."""
    while True:
        cost = candidate.fit.cost
        candidate = proceed(candidate)
        if not leaves_room(candidate.score) or before.cost - candidate.score.cost < 0.5 * LEAST_GAIN:
            break
        candidate = restart(candidate, LATER)
        if not candidate.fit.cost <= WORTHWHILE * cost:  # nor after a cost that is no number
            break
    return candidate


def finest(candidate: FittedCandidate, before: Score) -> FittedCandidate:
    """The candidate in its form with more parameters, if the data need it and it is better.

    Another law of the effect has to reach the floor or to explain most of what is left: it could absorb a part of a
    further effect that is missing.
    """
    finer = candidate.effect.refined()
    gain = before.cost - candidate.score.cost
    if finer is None or not leaves_room(candidate.score) or gain < LEAST_GAIN:
        return candidate
    refined = refit(candidate.fit.model.without(candidate.name), replace(candidate, effect=finer), LATER)
    if refined is None or refined.score.cost > candidate.score.cost - TIE:
        return candidate
    refined = settled(refined, before)
    most = max(ADEQUATE, REST * candidate.score.excess)
    return candidate if finer.name != candidate.name and refined.score.excess > most else refined


def simplest(refits: list[FittedCandidate]) -> FittedCandidate:
    """The refit with the fewest parameters among those that are as good as the best.

    A further number of a law must be visible: if another law of the effect reaches the floor, the gain over it has to
    exceed two standard errors.
    """
    best = refits[0]

    def is_tie(candidate: FittedCandidate) -> bool:
        lead, error = best.score.better_than(candidate.score)
        is_law = candidate.effect.public_name() == best.effect.public_name() and candidate.score.excess <= ADEQUATE
        return lead < TIE or (is_law and lead < 2.0 * error)

    return min(filter(is_tie, refits), key=lambda c: (len(c.fit.names), c.score.cost))


def best_of_each(refits: list[FittedCandidate]) -> list[FittedCandidate]:
    """The best refit of every effect, best first; a limit that bends all along the drive is a curve and not a limit."""
    worst_first = sorted((c for c in refits if not bends_all_along(c)), key=BY_COST, reverse=True)
    return sorted({c.name: c for c in worst_first}.values(), key=BY_COST)


def bends_all_along(candidate: FittedCandidate) -> bool:
    """Whether a limit bends over more than the whole drive range, so that it is a curve and not a limit."""
    saturates = candidate.name == AmplifierSaturation.name
    return saturates and candidate.effect["corner"] > candidate.training_data.extent.span
