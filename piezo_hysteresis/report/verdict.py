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

"""The verdict as text, at the top of the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..effects import CATALOGUE
from ..identification.free_run_error import Errors
from .figures.comparison import ModelComparison
from .words import nanometre

ENOUGH = 1.5
"""Mean square of error over noise floor up to which nothing is missing."""

HEADLINES = {
    "missing_effect": "Missing effect{s}: {names}",
    "changed_parameter": "A parameter of the model has changed: {names}",
    "nothing_missing": "Nothing is missing beyond the noise",
    "nothing_changed": "No change beyond the known error of the model is visible since it was identified",
    "time_limit": "The time limit ended the search before a verdict",
    "insufficient_data": "The data do not allow a verdict",
    "unexplained_gap": "Something is missing, but these data do not determine what it is",
    "": "No effect is named",
}
"""Headline of every conclusion in the answer of a diagnosis, with the names of the effects and the s of a plural; the
last one is for "unknown" in older files."""


@dataclass(frozen=True, slots=True)
class VerdictText:
    """A headline, and sentences: the first is the verdict, the others are details."""

    headline: str
    sentences: tuple[str, ...]


def verdict(comparison: ModelComparison, answer: Mapping[str, Any] | None = None) -> VerdictText:
    """The result of the comparison, and of the diagnosis if there is one.

    Parameters
    ----------
    comparison : ModelComparison
        Predictions of the models and the measurement.
    answer : mapping, optional
        Answer of a diagnosis, as in the JSON file.
    """
    severe = [n.message for n in comparison.experiment.notices if n.severe]
    cautions = tuple(f"Caution: {message}." for message in severe)
    now = comparison.now
    if now is None:
        return VerdictText(
            "The recording, without a model", (*cautions, "No model was given. Only the data are shown.")
        )
    if answer is None:
        more = "`piezo diagnose` looks for the missing effect."
        advice = () if is_at_floor(comparison, now) else (more,)
        headline = f"The model predicts this experiment to {now.percent:.2g} % of range"
        return VerdictText(headline, (*cautions, *_fit_sentences(comparison, now), *advice))
    said = answer_verdict(answer)
    return VerdictText(said.headline, (*said.sentences, *cautions, *_per_record_sentences(comparison)))


def answer_verdict(answer: Mapping[str, Any]) -> VerdictText:
    """The result of a diagnosis, from its answer as in the JSON file."""
    return VerdictText(_headline(answer), _sentences(answer))


def is_at_floor(comparison: ModelComparison, now: Errors) -> bool:
    """Whether nothing is left but noise: the mean square of error over noise floor is at most `ENOUGH`."""
    ratios = [(row.rms / comparison.floors[row.index]) ** 2 for row in now.judged]
    return bool(sum(ratios) / len(ratios) <= ENOUGH)


def _fit_sentences(comparison: ModelComparison, now: Errors) -> tuple[str, ...]:
    before = comparison.before
    floor = 100.0 * comparison.floor / now.range
    sentences = [
        f"In free run the error is {nanometre(now.rms)} rms over all phases, {now.percent:.3g} % of a range of "
        f"{nanometre(now.range)}; the noise floor is {floor:.2g} %."
    ]
    if before is not None:
        sentences.append(f"Before, it was {nanometre(before.rms)}, {before.percent:.3g} % of range.")
    sentences += _per_record_sentences(comparison)
    sentences.append(floor_sentence(comparison, now))
    return tuple(sentences)


def floor_sentence(comparison: ModelComparison, now: Errors) -> str:
    """Whether the error is at the noise floor; if not, where it is farthest above it."""
    if is_at_floor(comparison, now):
        return "This error is at the noise floor."
    worst = max(now.judged, key=lambda row: row.rms / comparison.floors[row.index])
    times = worst.rms / comparison.floors[worst.index]
    return f"The error is largest in {worst.phase}: {worst.percent:.3g} % of range, {times:.3g} times its noise floor."


def _per_record_sentences(comparison: ModelComparison) -> tuple[str, ...]:
    """Effects that are fitted to each recording, so that they are not predicted live."""
    model = comparison.model
    fitted = [] if model is None else [e.public_name() for e in model.effects if not e.is_predicted_live()]
    return tuple(
        f"{name.replace('_', ' ').capitalize()} is fitted to each recording in this error; it is not predicted live."
        for name in fitted
    )


def sentence(text: str) -> str:
    """A phrase as a sentence.

    >>> sentence("nothing is missing")
    'Nothing is missing.'
    """
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _headline(answer: Mapping[str, Any]) -> str:
    effects = answer.get("effects", ())
    names = " and ".join(effect["name"].replace("_", " ") for effect in effects)
    conclusion = answer.get("conclusion") or _conclusion(answer)
    return HEADLINES.get(conclusion, HEADLINES[""]).format(names=names, s="s" * (len(effects) > 1))


def _conclusion(answer: Mapping[str, Any]) -> str:
    """The conclusion of an answer that does not state it, as those of older versions."""
    if answer["verdict"] == "nothing_missing":
        return "nothing_missing"
    if any(effect.get("changed_parameter") for effect in answer.get("effects", ())):
        return "changed_parameter"
    return "missing_effect" if answer["verdict"] == "named" else ""


def _doubt(effect: Mapping[str, Any]) -> str:
    """What cannot be distinguished from a named effect, and whether at least its family is certain."""
    rivals = effect["confusable_with"]
    words = " or ".join(name.replace("_", " ") for name in rivals)
    said = f"The data cannot distinguish {effect['name'].replace('_', ' ')} from {words}"
    families = {e.family for e in CATALOGUE if e.public_name() in rivals}
    return f"{said}; the family ({effect['family']}) is certain." if families == {effect["family"]} else f"{said}."


def _sentences(answer: Mapping[str, Any]) -> tuple[str, ...]:
    effects = answer.get("effects", ())
    found = [sentence(answer["reason"])] if answer.get("reason") else []
    if effects and not found:
        names = " and ".join(effect["name"].replace("_", " ") for effect in effects).capitalize()
        explain = "explain" if len(effects) > 1 else "explains"
        found.append(f"{names} {explain} {100 * effects[-1]['explained_fraction']:.0f} % of the gap.")
    found += [_doubt(effect) for effect in effects if effect.get("confusable_with")]
    places = [place for place in answer.get("where", ()) if place.get("detail")]
    if places and answer["verdict"] != "nothing_missing":
        found.append(f"Most of the residual is here: {places[0]['detail'].rstrip('.')}.")
    gap = answer.get("gap_percent_of_range") or {}
    if gap.get("after") is not None:
        seen = "On the test records" if gap.get("unseen", True) else "On the fitted data"
        after = "after" if answer.get("effects") else "with the model that was fitted to these data"
        fell = "" if gap["after"] == gap["before"] else f" before and {gap['after']:.3g} % {after}"
        found.append(
            f"{seen} the gap (free-run error) is {gap['before']:.3g} % of the range{fell}; the noise floor is "
            f"{gap['floor']:.3g} %."
        )
    correction = answer.get("unnamed_correction")
    if correction:
        found.append(correction["reason"])
    following = answer.get("next_experiment")
    if following:
        found.append(following.get("reason") or f"To learn more, record the phase “{following['phase']}”.")
    return tuple(found)
