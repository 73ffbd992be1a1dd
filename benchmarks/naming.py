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

"""Naming benchmark: does the gap finder name exactly the hidden effects?

Prints every case when it ends, then the confusion matrix, the figures of every group, the gaps and the time. The
results are written to a JSON file after every case, so that a stopped run is not lost.

    python -m benchmarks.naming --quick
    python -m benchmarks.naming --seeds 5 --jobs 2 --json naming.json
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.figures import console
from benchmarks.naming_cases import GROUPS, NOISES, Case, cases
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.effects import BY_NAME

VISIBLE = 1.5
"""V of the refitted baseline above which an effect can be seen."""


@dataclass(frozen=True)
class Outcome:
    """One case with its answer."""

    group: str
    truth: tuple[str, ...]
    label: str
    seed: int
    noise: float
    plant: str
    layout: str
    verdict: str
    names: tuple[str, ...]
    families: tuple[str, ...]
    confusable: tuple[str, ...]
    right_families: tuple[str, ...]
    excess_before: float
    excess_after: float
    explained: float
    gap_before: float
    gap_after: float
    gap_floor: float
    seconds: float

    @property
    def visible(self) -> bool:
        """Whether the hidden effect is visible."""
        return self.excess_before > VISIBLE

    @property
    def rest_invisible(self) -> bool:
        """Whether effects that were not named are invisible: only noise remains with newly estimated dynamics."""
        return self.verdict != "unknown" and set(self.names) < set(self.truth) and self.excess_after <= VISIBLE

    @property
    def family_right(self) -> bool:
        """All families of the truth, and no other."""
        return set(self.families) == set(self.right_families)

    @property
    def name_right(self) -> bool:
        """The truth exactly."""
        return set(self.names) == set(self.truth)

    @property
    def is_false(self) -> bool:
        """Whether a family was named that is not in the stage."""
        return not set(self.families) <= set(self.right_families)


def answer(case: Case, explicit_step: bool = False) -> Outcome:
    """Make the data of a case and diagnose them; the time is the processor time of the diagnosis."""
    experiment = case.experiment()
    begin = time.process_time()
    found = diagnose(experiment, effects=case.library, explicit_step=explicit_step, cores=1)
    seconds = time.process_time() - begin
    selection, gap = found.selection, found.gap
    steps = selection.steps if selection is not None else ()
    last = selection.score.excess if selection is not None else np.nan
    return Outcome(
        group=case.group,
        truth=case.truth,
        label=case.label,
        seed=case.seed,
        noise=case.noise,
        plant=case.plant,
        layout=str(case.layout),
        verdict=str(found.verdict),
        names=found.names,
        families=tuple(BY_NAME[row["law"]].family for row in found.effects()),
        confusable=tuple(n for row in found.effects() for n in row["confusable_with"]),
        right_families=tuple(sorted(case.nameable)),
        excess_before=steps[0].before.excess if steps else last,
        excess_after=last,
        explained=selection.explained(selection.score) if selection is not None else 0.0,
        gap_before=gap.before if gap else np.nan,
        gap_after=gap.after if gap else np.nan,
        gap_floor=gap.floor if gap else np.nan,
        seconds=seconds,
    )


def confusion(outcomes: list[Outcome]) -> Table:
    """Hidden effects and answers, for single visible effects."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for o in outcomes:
        if o.group == "effects":
            answer = "+".join(o.names) if o.names else o.verdict if o.visible else "not visible"
            counts[o.truth[0]][answer] += 1
    table = Table("hidden", "said", title="confusion, single effects")
    for truth, said in counts.items():
        table.add_row(truth, ", ".join(f"{name} {n}" for name, n in said.most_common()))
    return table


def figures(outcomes: list[Outcome]) -> Table:
    """Shares of every group. Right answers are counted among the cases all of whose effects are visible."""
    table = Table("group", "cases", "visible", "families right", "names right", "unknown", "false family")
    for group in GROUPS:
        members = [o for o in outcomes if o.group == group]
        if not members:
            continue
        visible = [o for o in members if o.visible and not o.rest_invisible]
        seen = members if group == "effect_free" else visible
        table.add_row(
            group,
            str(len(members)),
            str(len(visible)),
            f"{sum(o.family_right for o in seen)} of {len(seen)}",
            f"{sum(o.name_right for o in seen)} of {len(seen)}",
            str(sum(o.verdict == "unknown" for o in members)),
            f"{sum(o.is_false for o in members)} of {len(members)}",
        )
    return table


def gaps(outcomes: list[Outcome]) -> Table:
    """Removed share of the gap if an effect was named right."""
    table = Table("hidden", "cases", "before, %", "after, %", "floor, %", "removed, median %", title="gap, unseen data")
    named: dict[str, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        if o.names and o.family_right:
            named["+".join(o.truth)].append(o)
            named["all"].append(o)
    for truth, members in named.items():
        before, after, floor = (
            np.array([getattr(o, f"gap_{k}") for o in members]) for k in ("before", "after", "floor")
        )
        removed = 100 * (1 - np.maximum(after - floor, 0) / np.maximum(before - floor, 1e-12))
        row = [f"{np.median(x):.3f}" for x in (before, after, floor)]
        table.add_row(truth, str(len(members)), *row, f"{np.median(np.clip(removed, 0, 100)):.0f}")
    return table


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="seeds of every effect; other groups in proportion")
    parser.add_argument("--quick", action="store_true", help="one seed at the middle noise")
    parser.add_argument("--cases", type=int, help="largest number of cases")
    parser.add_argument("--groups", nargs="+", choices=(*GROUPS, "quick", "explicit"), default=list(GROUPS))
    parser.add_argument("--explicit-step", action="store_true", help="as in piezo diagnose; for the group explicit")
    parser.add_argument("--only", default="", help="cases whose label contains this word")
    parser.add_argument("--json", type=Path, help="outcomes as JSON")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each on a core")
    options = parser.parse_args()
    seeds, noises = (1, (NOISES[1],)) if options.quick else (options.seeds, NOISES)
    wanted = [c for c in cases(tuple(options.groups), seeds, noises) if options.only in c.label][: options.cases]
    out, outcomes, crashes = console(), list[Outcome](), 0
    pool = ProcessPoolExecutor(options.jobs)
    answers = [pool.submit(answer, case, options.explicit_step) for case in wanted]
    for k, (case, found) in enumerate(zip(wanted, answers, strict=True), 1):
        try:
            outcome = found.result()
        except Exception as error:  # a crash is counted, and the benchmark continues
            out.print(f"{k}/{len(wanted)} {case.label} seed {case.seed}: [red]{error!r}")
            crashes += 1
            continue
        outcomes.append(outcome)
        said = " and ".join(outcome.names) or outcome.verdict
        mark = "[red]false[/]" if outcome.is_false else "" if outcome.family_right else "[yellow]missed[/]"
        out.print(
            f"{k}/{len(wanted)} {outcome.label} seed {case.seed} {case.plant} noise {100 * case.noise:g} %: {said} "
            f"V {outcome.excess_before:.2f} → {outcome.excess_after:.2f}, gap {outcome.gap_before:.3f} → "
            f"{outcome.gap_after:.3f} %, floor {outcome.gap_floor:.3f} %, {outcome.seconds:.1f} s {mark}",
            highlight=False,
            soft_wrap=True,
        )
        if options.json:
            options.json.write_text(json.dumps([asdict(o) for o in outcomes], indent=1))
    pool.shutdown()
    for table in (confusion(outcomes), figures(outcomes), gaps(outcomes)):
        out.print(table)
    out.print(f"{crashes} of {len(wanted)} diagnoses crashed")
    spent = np.array([o.seconds for o in outcomes])
    half, most = np.quantile(spent, (0.5, 0.95))
    out.print(
        f"processor time per diagnosis: median {half:.1f} s, 95 % within {most:.1f} s, longest {spent.max():.1f} s"
    )


if __name__ == "__main__":
    main()
