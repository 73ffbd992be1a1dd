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

"""`LiveDiagnosis`: after every tier it updates the probabilities, and either ends or chooses the next phases."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...effects import CATALOGUE, Effect
from ...errors import ParameterError
from ...identification.fit.fit import Progress
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import ProtocolPhase
from ...record import Experiment
from ..diagnose import diagnose
from ..diagnosis import Diagnosis
from ..verdict import Verdict
from .probabilities import NONE_OF_THESE, NOTHING, probabilities
from .rivals import rivals_of
from .still_hidden import still_hidden
from .tiers import FAST_TIERS, SLOW_FAMILIES, Tier, spare_drives, tiers
from .time_to_decide import ERROR_RATE, LONGEST, Separation, best_drive, missing_log_odds
from .update import End, Update, percent

MOST_RIVALS = 3
"""Largest number of rivals for which a drive is chosen; with more rivals the fixed order continues."""
DETOUR = 0.1
"""Stage time of all chosen drives, as a share of that of all tiers; wrong choices cost no more."""
MOST_CHOSEN = 4
"""Largest number of consecutive chosen drives. If none of them decides, the prediction of their results is wrong."""


@dataclass(frozen=True, eq=False, slots=True)
class LiveDiagnosis:
    """State of a diagnosis that chooses its own phases; `advanced` returns the next one.

    Parameters
    ----------
    limits : DriveLimits
        Limits of the stage; every phase stays inside them.
    plan : tuple of Tier
        The fixed order, short tiers first.
    error_rate : float
        Accepted probability of a wrong answer, between 0 and 0.5.
    longest : float
        Longest stage time [s].
    seed : int
        Seed of the random waveforms.
    effects : tuple of Effect classes
        Effects to choose from.
    chooses : bool
        Whether drives are chosen to separate rivals; otherwise the fixed order continues.
    due : tuple of ProtocolPhase
        Phases to play next; empty at the end.
    due_name : str
        Short description of these phases.
    tier : int
        Number of tiers that were played or are due.
    chosen : int
        Number of consecutive drives that were chosen since the last tier.
    time : float
        Stage time so far [s].
    updates : tuple of Update
        Probabilities after every decision.
    found : Diagnosis or None
        The last diagnosis.
    separation : Separation or None
        Expected separation of the rivals by the best drive, at the last choice.
    untested : tuple of str
        Public names of the effects that the phases so far could not show.
    end : End or None
        Reason of the end; None before the end.
    """

    limits: DriveLimits
    plan: tuple[Tier, ...]
    error_rate: float = ERROR_RATE
    longest: float = LONGEST
    seed: int = 0
    effects: tuple[type[Effect], ...] = CATALOGUE
    chooses: bool = True
    due: tuple[ProtocolPhase, ...] = ()
    due_name: str = ""
    tier: int = 0
    chosen: int = 0
    time: float = 0.0
    updates: tuple[Update, ...] = ()
    found: Diagnosis | None = None
    separation: Separation | None = None
    untested: tuple[str, ...] = ()
    end: End | None = None

    def advanced(self, experiment: Experiment, progress: Progress | None = None) -> LiveDiagnosis:
        """The state after the phases that were due have been played.

        Parameters
        ----------
        experiment : Experiment
            Everything recorded so far.
        progress : callable, optional
            Called with a message and the fraction done.

        Raises
        ------
        PiezoError
            As `diagnose` does.
        """
        found = diagnose(experiment, effects=self.effects, progress=progress)
        time = self.time + sum(p.duration for p in self.due)
        untested = self._untested_by(found, time)
        by_name = probabilities(found, {e.public_name() for e in self.effects}, untested)
        updates = (*self.updates, Update(time, self.due_name, by_name))
        after = replace(self, time=time, updates=updates, found=found, separation=None, untested=untested)
        return after._decided()

    @property
    def answer_is_sure(self) -> bool:
        """Whether the likeliest explanation reaches 1 − error rate, and the rules of the diagnosis agree with it."""
        if not self.updates or self.found is None:
            return False
        update = self.updates[-1]
        if update.probabilities[update.likeliest] < 1.0 - self.error_rate:
            return False
        if update.likeliest == NOTHING:
            return self.found.verdict is Verdict.NOTHING_MISSING
        if update.likeliest == NONE_OF_THESE:
            return self.found.verdict is Verdict.UNKNOWN and not self._left()
        return self.found.verdict is Verdict.NAMED and " + ".join(self.found.names) == update.likeliest

    def reason(self) -> str:
        """Reason of the end, and what the phases so far could not show."""
        untested = " and ".join(name.replace("_", " ") for name in self.untested)
        return self._why_ended() + (f" The phases so far could not show {untested}." if untested else "")

    def _why_ended(self) -> str:
        update = self.updates[-1]
        likeliest = update.likeliest.replace("_", " ")
        share = percent(update.probabilities[update.likeliest])
        if self.end is End.SURE:
            return f"Stopped after {update.time:.1f} s: the probability of {likeliest} is {share}."
        if self.end is End.UNDECIDABLE and self.separation is not None:
            return f"No decision is possible within the limits and {self.longest:g} s. {self.separation.sentence()}"
        further = "" if self.separation is None else f" {self.separation.sentence()}"
        return (
            f"All planned phases that fit into {self.longest:g} s were played ({update.time:.1f} s), and no "
            f"explanation is certain: {update.sentence()}.{further}"
        )

    def answer(self) -> dict[str, Any]:
        """The part ``live`` of ``answer.json``."""
        closest = self.separation if self.end is End.UNDECIDABLE else None
        return {
            "end": None if self.end is None else str(self.end),
            "reason": self.reason(),
            "stage_time_s": round(self.time, 6),
            "error_rate": self.error_rate,
            "probabilities": [
                {"time_s": round(u.time, 6), "played": u.played, "probabilities": u.probabilities} for u in self.updates
            ],
            "untested": list(self.untested),
            "undecidable": closest and {"rivals": list(closest.rivals), "drive": closest.drive, **closest.numbers()},
        }

    @property
    def _detour_left(self) -> float:
        """Stage time that further chosen drives may take [s]."""
        spent = self.time - sum(tier.duration for tier in self.plan[: self.tier])
        return DETOUR * sum(tier.duration for tier in self.plan) - spent

    def _left(self) -> tuple[Tier, ...]:
        """Tiers that were not played yet and fit into the remaining time."""
        left = self.plan[self.tier :]
        return left if left and left[0].duration <= self.longest - self.time else ()

    def _untested_by(self, found: Diagnosis, time: float) -> tuple[str, ...]:
        """Effects that only later phases can show."""
        left = [phase for tier in self.plan[self.tier :] for phase in tier.phases]
        if not left:
            return ()
        slow = [e for e in self.effects if e.family in SLOW_FAMILIES]
        selection = found.selection
        if (
            found.verdict is not Verdict.NOTHING_MISSING
            or selection is None
            or selection.training_data is None
            or self.tier < FAST_TIERS
        ):
            return tuple(sorted({e.public_name() for e in slow} - set(found.names)))
        shown = still_hidden(selection.model, selection.training_data, slow, left, time, self.error_rate)
        return tuple(sorted(shown))

    def _decided(self) -> LiveDiagnosis:
        if self.answer_is_sure:
            return replace(self, due=(), due_name="", end=End.SURE)
        found, likely = self.found, self.updates[-1].probabilities
        left = self._left()
        rivals = rivals_of(found, likely, self.error_rate)
        separation = None
        if self.chooses and 2 <= len(rivals) <= MOST_RIVALS and self.chosen < (1 if left else MOST_CHOSEN):
            drives = (*(p for tier in left for p in tier.phases), *spare_drives(self.limits, self.seed))
            chosen = best_drive(rivals, drives, missing_log_odds(likely, self.error_rate), self.longest - self.time)
            if chosen is not None:
                phases, separation = chosen
                if separation.decides and separation.duration <= self._detour_left:
                    name = f"{separation.drive}, to separate {' from '.join(separation.rivals)}"
                    return replace(self, due=phases, due_name=name, separation=separation, chosen=self.chosen + 1)
        if left:
            first = left[0]
            return replace(
                self, due=first.phases, due_name=first.name, tier=self.tier + 1, chosen=0, separation=separation
            )
        end = End.EXHAUSTED if separation is None or separation.decides else End.UNDECIDABLE
        return replace(self, due=(), due_name="", separation=separation, end=end)


def begin(
    limits: DriveLimits,
    *,
    error_rate: float = ERROR_RATE,
    longest: float = LONGEST,
    seed: int = 0,
    effects: tuple[type[Effect], ...] = CATALOGUE,
    chooses: bool = True,
) -> LiveDiagnosis:
    """A live diagnosis before anything has moved; its first tier is due.

    Parameters
    ----------
    limits, error_rate, longest, seed, effects, chooses
        As for `LiveDiagnosis`.

    Raises
    ------
    ParameterError
        If the error rate is not between 0 and 0.5, or the first tier does not fit into the time.
    """
    plan = tiers(limits, seed)
    first = plan[0]
    if not 0.0 < error_rate < 0.5:
        raise ParameterError(f"error rate: got {error_rate:g}, expected more than 0 and less than 0.5")
    if not longest >= first.duration:
        raise ParameterError(
            f"stage time: got {longest:g} s, expected at least the {first.duration:.1f} s of the first phases"
        )
    return LiveDiagnosis(
        limits, plan, error_rate, longest, seed, effects, chooses, due=first.phases, due_name=first.name, tier=1
    )
