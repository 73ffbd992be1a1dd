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

"""`Diagnosis`: the answer, as data, as text, and in the stable form of ``answer.json``."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..changes.change_kinds import ParameterChange
from ..effects import CHAIN
from ..html_table import html_table
from ..identification.fit.fit import Fit
from ..model.model import Model
from ..picture import Pictured
from ..record import Experiment
from .choice.time_to_decide import Separation
from .gap import Gap, gap_answer
from .localise import ResidualShare
from .search.selection_result import Selection
from .unnamed.correction import Correction
from .verdict import Conclusion, Verdict

SCHEMA = 1
"""Version of the JSON answer."""


@dataclass(frozen=True, eq=False, slots=True)
class Diagnosis(Pictured):
    """Where a model is wrong, which effect is missing, and the gap after adding it.

    Parameters
    ----------
    conclusion : Conclusion
        What was found; the verdict (named, nothing missing, or unknown) follows from it.
    reason : str
        What was found and why, in one or a few sentences.
    model : Model
        The model with the named effects; without any, the best of refitted baseline, given model and other structure.
    baseline : Model
        The given model; without one, the refitted model without the effects.
    experiment : Experiment
        Experiment that was compared with the model, without the noise of a measured voltage. Its notices describe the
        quality of the data, and the effects that the data cannot show.
    selection : Selection or None
        Every step of the search; None if the data did not allow a search.
    fit : Fit or None
        Last joint fit, with uncertainties; None if the model is not from it.
    where : tuple of ResidualShare
        Distribution of the residual of the baseline.
    gap : Gap or None
        Free-run error before and after.
    next_experiment : Separation or None
        Drive that would separate two explanations that these data cannot distinguish.
    change : ParameterChange or None
        Changed parameter of a given model, if this change explains the records.
    correction : Correction or None
        After "unknown": the best correction without a name, accepted or refused. It is not part of `model`.
    """

    conclusion: Conclusion
    reason: str
    model: Model | None
    baseline: Model | None
    experiment: Experiment
    selection: Selection | None = None
    fit: Fit | None = None
    where: tuple[ResidualShare, ...] = ()
    gap: Gap | None = None
    next_experiment: Separation | None = None
    change: ParameterChange | None = None
    correction: Correction | None = None

    @property
    def verdict(self) -> Verdict:
        """Named, nothing missing, or unknown."""
        return self.conclusion.verdict

    @property
    def names(self) -> tuple[str, ...]:
        """Identifiers of the named effects, in the order of the search."""
        if self.change is not None:
            return self.change.names
        if self.verdict is not Verdict.NAMED or self.selection is None:
            return ()
        return tuple(s.best.effect.public_name() for s in self.selection.accepted)

    @property
    def rejected(self) -> dict[str, str]:
        """Effects that were not named, by name, with the reason given in the last step."""
        reasons: dict[str, str] = {}
        if self.selection is None:
            return reasons
        for step in self.selection.steps:
            if self.verdict is Verdict.UNKNOWN and step.accepted:
                reasons[step.best.name] = self._why_unnamed(step.best.name, self.selection)
            reasons.update(step.rejected)
        forms = {e.name for e in CHAIN if e.public_name() in self.names}
        return {name: reason for name, reason in reasons.items() if name not in forms}

    def _why_unnamed(self, name: str, selection: Selection) -> str:
        """Why an effect is not named that the search added."""
        if self.gap is not None and self.model is not None and name in self.model:
            return f"it is in the model but not named: the model explains {100 * self.gap.explained:.0f} % of the gap"
        share, names = selection.explained(selection.score), [s.best.effect.public_name() for s in selection.accepted]
        return f"the closest effect is {' with '.join(names)}, which explains only {100 * share:.0f} % of the gap"

    def effects(self) -> list[dict[str, Any]]:
        """The named effects, as in ``answer.json``."""
        if self.change is not None and self.gap is not None:
            return self.change.rows(self.gap.explained)
        if self.verdict is not Verdict.NAMED or self.selection is None or self.fit is None or self.gap is None:
            return []
        rows = []
        for step in self.selection.accepted:
            effect = self.fit.model[step.best.name]
            rows.append(
                {
                    "name": effect.public_name(),
                    "law": effect.name,
                    "family": effect.family,
                    "predicted_live": effect.is_predicted_live(),
                    "member_certain": step.member_certain,
                    "explained_fraction": round(self.gap.explained_by_effects, 4),
                    "parameters": _parameters(self.fit, effect.name),
                    "confusable_with": list(step.confusable_with),
                    "held_out_gain": round(step.before.cost - step.best.score.cost, 4),
                }
            )
        return rows

    def answer(self, model_file: str = "") -> dict[str, Any]:
        """The answer for ``answer.json``, in a stable, versioned form.

        Parameters
        ----------
        model_file : str
            File to which the extended model was written.
        """
        return {
            "schema": SCHEMA,
            "verdict": str(self.verdict),
            "conclusion": str(self.conclusion),
            "reason": self.reason,
            "effects": self.effects(),
            "where": [{"axis": p.axis, "share": round(p.share, 4), "detail": p.detail} for p in self.where],
            "gap_percent_of_range": gap_answer(self.gap),
            "rejected": [{"name": name, "reason": reason} for name, reason in self.rejected.items()],
            "next_experiment": None if self.next_experiment is None else self.next_experiment.answer(),
            "data_quality": [asdict(n) for n in self.experiment.notices],
            "unnamed_correction": None if self.correction is None else self.correction.answer(),
            "model": model_file,
        }

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict}: {self.reason})"

    def _repr_html_(self) -> str:
        return html_table(repr(self), ("effect", "family"), ((e["name"], e["family"]) for e in self.effects()))

    def summary(self) -> str:
        """The answer as text of several lines."""
        lines = [self.reason]
        for row in self.effects():
            lines.append(f"  {row['name']} ({row['family']})")
            for name, p in row["parameters"].items():
                ends = p["interval_95"]
                known = f"95 %: {ends[0]:.4g} to {ends[1]:.4g}" if ends else "not determined"
                lines.append(f"    {name} = {p['value']:.4g} {p['unit']} ({known})")
            if row["confusable_with"]:
                lines.append(f"    the data cannot distinguish it from {', '.join(row['confusable_with'])}")
        if self.gap is not None:
            g = self.gap
            seen = "test records" if g.unseen else "training records, because there were too few for test records"
            share = f" ({100 * g.explained:.0f} % explained)" if self.names else ""
            lines.append(
                f"  gap {g.before:.3g} % → {g.after:.3g} % of range{share}, noise floor {g.floor:.3g} % (on the {seen})"
            )
        if self.correction is not None:
            lines.append(f"  {self.correction.sentence()}")
        lines += [f"  where: {p.axis.replace('_', ' ')}: {p.detail}" for p in self.where[:3]]
        if self.next_experiment is not None:
            lines.append(f"  next: {self.next_experiment.sentence()}")
        lines += [f"  {n.kind}: {n.message}" for n in self.experiment.notices if n.severe]
        return "\n".join(lines)


def _parameters(fit: Fit, effect: str) -> dict[str, dict[str, Any]]:
    """The fitted parameters of an effect, as in ``answer.json``."""
    rows: dict[str, dict[str, Any]] = {}
    for name, value in fit.model.values().items():
        owner, _, parameter = name.partition(".")
        row = fit.model.row(name)
        if owner == effect and not row.fixed and not row.per_record:
            # a number that was assumed, or does not act in these records, has no interval
            ends = fit.interval(name) if fit.standard_errors.get(name) else None
            interval = None if ends is None else [min(max(end, row.lower), row.upper) for end in ends]
            rows[parameter] = {"value": value, "interval_95": interval, "unit": row.unit}
    return rows
