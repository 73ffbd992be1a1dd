"""Forward selection of missing effects: screen, refit the best, choose on records left out, add, repeat, stop.

Bacher and Madsen 2011 for the forward selection; Brynjarsdóttir and O'Hagan 2014 for why discrepancy needs structure.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects import CATALOGUE, Effect
from ..model import Model
from .candidates import Candidate, Evidence, alikeness, refit, restart, screen
from .held_out import Score

Progress = Callable[[str, float], None]

ADEQUATE = 1.5
"""Mean R² up to which nothing is missing beyond noise."""
LEAST_GAIN = 0.15
"""Least gain in mean ln max(1, R²) for which an effect is accepted."""
KEEPS = (0.8, 0.6)
"""Share of V that may remain after the first accepted effect, and after further ones."""
NAMED = 0.6
"""Explained fraction of the gap from which a family is named."""
REFITS = 6
"""Candidates that are refitted jointly."""
AGAIN = 3
"""Refits that begin once more behind dynamics found anew."""
RESTARTS = 4
WORTHWHILE = 0.8
"""Share of the cost above which beginning anew once more is not worth it."""
MOST = 3
"""Effects at most."""
CLOSE = 0.3
"""Share of the best gain by which a rival may lie behind."""
ALIKE = 0.97
"""|cos| of two signatures from which they count as one."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """An effect that was not added, and why."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class Step:
    """One turn of the selection.

    Parameters
    ----------
    before : Score
        Of the model without the effect.
    best : Candidate
        The best refit.
    accepted : bool
        Whether it was added.
    rivals : tuple of Candidate
        Refits that records left out cannot tell from the best.
    rejected : tuple of Rejection
        All others.
    """

    before: Score
    best: Candidate
    accepted: bool
    rivals: tuple[Candidate, ...]
    rejected: tuple[Rejection, ...]

    @property
    def confusable_with(self) -> tuple[str, ...]:
        """Effects that would explain the same."""
        names = dict.fromkeys(r.effect.public_name() for r in self.rivals)
        return tuple(n for n in names if n != self.best.effect.public_name())

    @property
    def member_certain(self) -> bool:
        """True where no other member of the same family is a rival."""
        mine = self.best.effect
        return all(r.effect.family != mine.family or r.effect.public_name() == mine.public_name() for r in self.rivals)


@dataclass(frozen=True, eq=False, slots=True)
class Selection:
    """Outcome of the forward selection.

    Parameters
    ----------
    baseline : Model
        What the selection began with.
    model : Model
        With all accepted effects.
    score : Score
        Of `model`.
    steps : tuple of Step
        In order; the last may not be accepted.
    null : float
        V that a perfect model would have.
    """

    baseline: Model
    model: Model
    score: Score
    steps: tuple[Step, ...]
    null: float

    @property
    def accepted(self) -> tuple[Step, ...]:
        """The turns that added an effect."""
        return tuple(s for s in self.steps if s.accepted)

    def explained(self, score: Score) -> float:
        """Share X of the gap of the baseline that a score has closed, 0 to 1."""
        first = self.steps[0].before.excess if self.steps else self.score.excess
        return explained(first, score.excess, self.null)


def explained(before: float, after: float, null: float) -> float:
    """X = 1 − √((V_after − V_null)/(V_before − V_null)), between 0 and 1."""
    gap = before - null
    return float(1.0 - np.sqrt(np.clip((after - null) / gap, 0.0, 1.0))) if gap > 0 else 1.0


def select(
    model: Model,
    evidence: Evidence,
    score: Score,
    null: float,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
) -> Selection:
    """Add effects while records left out ask for them.

    Parameters
    ----------
    model : Model
        Fitted baseline.
    evidence : Evidence
        Records that fit and choose.
    score : Score
        Of the baseline.
    null : float
        V of a perfect model.
    effects : collection of Effect classes
        The library to choose from.
    progress : callable, optional
        Called with a word and the fraction done.
    """
    baseline, steps = model, list[Step]()
    while score.excess > ADEQUATE and len(steps) < MOST:
        step = _turn(model, evidence, score, effects, KEEPS[min(len(steps), 1)], progress)
        if step is None:
            break
        steps.append(step)
        if not step.accepted:
            break
        assert step.best.fit is not None
        model, score, evidence = step.best.fit.model, step.best.score, step.best.evidence
    model, score = _pruned(model, score, steps)
    return Selection(baseline, model, score, tuple(steps), null)


def _pruned(model: Model, score: Score, steps: list[Step]) -> tuple[Model, Score]:
    """Take back effects that a later one makes superfluous; `steps` is updated."""
    accepted = [k for k, step in enumerate(steps) if step.accepted]
    for k in accepted[:-1]:
        name, last = steps[k].best.name, steps[accepted[-1]].best
        lean = refit(model.without(name), replace(last, effect=model[last.name]))
        if lean is None:
            continue
        lean = _settled(lean)
        if lean.score.cost - score.cost < LEAST_GAIN and lean.fit is not None:
            told = Rejection(name, f"superfluous once {last.name} is there")
            steps[k] = replace(steps[k], accepted=False, rejected=(told, *steps[k].rejected))
            model, score = lean.fit.model, lean.score
    return model, score


def _turn(
    model: Model,
    evidence: Evidence,
    before: Score,
    effects: Collection[type[Effect]],
    keeps: float,
    progress: Progress | None,
) -> Step | None:
    def tell(word: str, fraction: float) -> None:
        if progress is not None:
            progress(word, fraction)

    tell("score test of the catalogue", 0.0)
    present = {e.public_name() for e in model.effects}
    screened = screen(model, evidence, [e for e in effects if e.public_name() not in present])
    refits = _refitted(model, screened[:REFITS], before, tell)
    if not refits:
        return None
    best = _simplest(refits)
    rivals, rejected = [], []
    gain = before.cost - best.score.cost
    accepted = gain >= LEAST_GAIN and best.score.excess <= keeps * before.excess
    for candidate in refits:
        if candidate is best:
            continue
        lead, error = best.score.better_than(candidate.score)
        close = lead < CLOSE * gain
        if accepted and close and (lead < 2.0 * error or alikeness(best, candidate, model) > ALIKE):
            rivals.append(candidate)
        else:
            rejected.append(Rejection(candidate.name, f"held-out score {lead:.2f} ± {error:.2f} behind {best.name}"))
    rejected += [
        Rejection(c.name, f"score test: at most {max(0.0, before.cost - c.score.cost):.2f} of held-out gain")
        for c in screened[REFITS:]
    ]
    if not accepted:
        left = best.score.excess / before.excess
        reason = f"closest, but a held-out gain of {gain:.2f} and {left:.2f} of V left do not suffice"
        rejected.insert(0, Rejection(best.name, reason))
    return Step(before, best, accepted, tuple(rivals), tuple(rejected))


def _refitted(model: Model, candidates: Sequence[Candidate], before: Score, tell: Progress) -> list[Candidate]:
    """Joint refits, best first; the leading ones begun anew, but not those far behind a best at the floor."""
    refits = []
    for k, candidate in enumerate(candidates):
        tell(f"refit with {candidate.name}", (k + 1) / (len(candidates) + 1))
        result = refit(model, candidate)
        if result is not None:
            refits.append(result)
    if not refits:
        return []
    refits.sort(key=lambda c: c.score.cost)
    tell("dynamics anew", 0.9)
    best = _settled(refits[0])
    reach = np.inf
    if best.score.excess <= ADEQUATE:
        reach = best.score.cost + CLOSE * (before.cost - best.score.cost)
    again = [_settled(c) if c.score.cost < reach else c for c in refits[1:AGAIN]]
    return sorted([best, *again, *refits[AGAIN:]], key=lambda c: c.score.cost)


def _settled(candidate: Candidate) -> Candidate:
    """The refit begun anew while that still closes much of what is left."""
    for _ in range(RESTARTS):
        if candidate.score.excess <= ADEQUATE:
            break
        before, candidate = candidate, restart(candidate)
        assert before.fit is not None and candidate.fit is not None
        if candidate.fit.cost > WORTHWHILE * before.fit.cost:
            break
    return candidate


def _simplest(refits: list[Candidate]) -> Candidate:
    """The refit with the fewest numbers among those that are as good as the best."""
    best = refits[0]
    assert best.fit is not None
    ties = [c for c in refits if c is best or c.score.cost - best.score.cost < 0.02]
    return min(ties, key=lambda c: (len(c.fit.names) if c.fit else 0, c.score.cost))
