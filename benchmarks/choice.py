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

"""Benchmark of the live diagnosis: stage time, and number of wrong names.

Stages that share no code with the catalogue are driven tier by tier until the answer is certain. If a drive was chosen,
the same stage is also driven in the fixed order. Prints every case when it ends, then the figures of every group.

    python -m benchmarks.choice --seeds 1
    python -m benchmarks.choice --groups twins effects --seeds 2 --json choice.json
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.figures import console
from benchmarks.independent_plant import NATIVE, Plant
from benchmarks.naming_cases import NOISES, Case, cases
from piezo_hysteresis.discrepancy.choice.live_diagnosis import LiveDiagnosis, begin
from piezo_hysteresis.effects import BY_NAME
from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.phases import ProtocolPhase
from piezo_hysteresis.record import Experiment, Record

RICH = 158.7
"""Stage time of the fixed protocol ``rich`` [s]."""
GROUPS = ("effect_free", "effects", "pairs", "uncatalogued", "absent", "twins")
TWINS = ("softening", "sensor_nonlinearity")
"""The same on slow drive; the group ``twins`` hides them where the slew limit allows no other."""
SLOW_SLEW = 150.0
"""Slew limit of the group ``twins`` [V/s on a range of 10 V]."""
COARSE = 5
"""Samples of the fastest period in one of a slow phase, which the plant runs quasi-statically."""


@dataclass(frozen=True)
class Outcome:
    """One stage with its answer."""

    group: str
    truth: tuple[str, ...]
    label: str
    seed: int
    noise: float
    end: str
    verdict: str
    names: tuple[str, ...]
    right_families: tuple[str, ...]
    families: tuple[str, ...]
    stage_time: float
    fixed_time: float
    chosen: int
    z: tuple[float, float] | None
    probability: float
    seconds: float
    trace: tuple[str, ...]

    @property
    def is_wrong(self) -> bool:
        """True if an effect that is not in the stage was named with certainty."""
        return self.end == "sure" and not set(self.families) <= set(self.right_families)

    @property
    def is_right(self) -> bool:
        """True if exactly the hidden effects were named; none where the catalogue does not hold them."""
        return set(self.names) == (set(self.truth) if self.right_families else set())


def play(plant: Plant, phases: tuple[ProtocolPhase, ...], rng: np.random.Generator, clock: float) -> list[Record]:
    """Records of phases, each from rest as this plant plays them; slow ones quasi-statically."""
    records = []
    for phase in phases:
        every, drive, period = phase.stored_every, phase.voltage, NATIVE
        if every > COARSE:
            every, drive, period = every // COARSE, drive[::COARSE], NATIVE * COARSE
        records.append(plant.play(drive, period, phase.name, rng, clock, every))
        clock += phase.duration
    return records


def live_run(case: Case, chooses: bool) -> tuple[LiveDiagnosis, int]:
    """Drive the stage of a case until the live diagnosis ends; how many drives were chosen."""
    plant, seed = case.player()
    assert isinstance(plant, Plant)
    slew = SLOW_SLEW * plant.volt / 10.0 if case.group == "twins" else np.inf
    limits = DriveLimits(NATIVE, 0.0, 0.8 * plant.volt, 0.0, slew, 5.0 * plant.volt)
    rng = np.random.default_rng(seed)
    live = begin(limits, seed=seed % 1000, effects=case.library, chooses=chooses)
    records: list[Record] = []
    chosen = 0
    while live.due:
        records += play(plant, live.due, rng, live.time)
        live = live.advanced(Experiment(tuple(records)))
        chosen += live.chosen > 0
    return live, chosen


def answer(case: Case) -> Outcome:
    """Drive the stage, and once more in the fixed order where a drive was chosen."""
    begun = time.process_time()
    live, chosen = live_run(case, True)
    seconds = time.process_time() - begun
    fixed = live_run(case, False)[0].time if chosen else live.time
    found, update = live.found, live.updates[-1]
    assert found is not None
    z = None if live.separation is None else (live.separation.expected_z, live.separation.needed_z)
    return Outcome(
        group=case.group,
        truth=case.truth,
        label=case.label,
        seed=case.seed,
        noise=case.noise,
        end=str(live.end),
        verdict=str(found.verdict),
        names=found.names,
        right_families=tuple(sorted(case.nameable)),
        families=tuple(BY_NAME[row["law"]].family for row in found.effects()),
        stage_time=live.time,
        fixed_time=fixed,
        chosen=chosen,
        z=z,
        probability=update.probabilities[update.likeliest],
        seconds=seconds,
        trace=tuple(f"{u.time:.1f} s: {u.sentence()}" for u in live.updates),
    )


def wanted(groups: tuple[str, ...], seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    """Cases of the independent plant. The groups take turns, so that a stopped run contains all of them."""
    kinds: list[list[Case]] = []
    for group in groups:
        if group == "twins":
            kinds.append([Case("twins", (n,), k, noises[0]) for k in range(2 * seeds) for n in TWINS])
            continue
        share = 1 if group == "effect_free" else seeds
        kinds.append([replace(case, plant="independent") for case in cases((group,), share, noises)])
    places = [(k / len(kind), case) for kind in kinds for k, case in enumerate(kind)]
    yield from (case for _, case in sorted(places, key=lambda place: place[0]))


def figures(outcomes: list[Outcome]) -> Table:
    """Stage times, and how the answers ended, by group."""
    ends = ("sure", "undecidable", "exhausted")
    table = Table("group", "stages", *ends, "right", "wrong names", "stage time: mean, median, longest [s]")
    by_group: dict[str, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        by_group[o.group].append(o)
    for group, members in [*by_group.items(), ("all", outcomes)]:
        times = np.array([o.stage_time for o in members])
        table.add_row(
            group,
            str(len(members)),
            *(str(sum(o.end == end for o in members)) for end in ends),
            str(sum(o.is_right for o in members)),
            f"{sum(o.is_wrong for o in members)} of {len(members)}",
            f"{times.mean():.1f}, {np.median(times):.1f}, {times.max():.1f}",
        )
    return table


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, help="seeds of every effect; other groups in proportion")
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=["effect_free", "effects"])
    parser.add_argument("--only", default="", help="cases whose label contains this word")
    parser.add_argument("--cases", type=int, help="largest number of cases")
    parser.add_argument("--all-noises", action="store_true", help="noise of 0.01, 0.05 and 0.2 %%; otherwise 0.05 %%")
    parser.add_argument("--json", type=Path, help="outcomes as JSON, written after every case")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each on a core")
    options = parser.parse_args()
    noises = NOISES if options.all_noises else (NOISES[1],)
    chosen = [c for c in wanted(tuple(options.groups), options.seeds, noises) if options.only in c.label]
    chosen = chosen[: options.cases]
    out, outcomes = console(), list[Outcome]()
    with ProcessPoolExecutor(options.jobs) as pool:
        answers = {pool.submit(answer, case): case for case in chosen}
        for k, done in enumerate(as_completed(answers), 1):
            case = answers[done]
            try:
                o = done.result()
            except PiezoError as error:
                out.print(f"{k}/{len(chosen)} {case.label} seed {case.seed}: {error!r}")
                continue
            outcomes.append(o)
            said = " + ".join(o.names) or o.verdict
            mark = "WRONG" if o.is_wrong else ""
            out.print(
                f"{k}/{len(chosen)} {o.label} seed {o.seed} noise {100 * o.noise:g} %: {said}, {o.end}, "
                f"p {o.probability:.4f}, {o.stage_time:.1f} s (fixed order {o.fixed_time:.1f} s), chosen {o.chosen}, "
                f"z {o.z}, {o.seconds:.1f} s of processor time {mark}",
                highlight=False,
                soft_wrap=True,
            )
            if options.json:
                options.json.write_text(json.dumps([asdict(o) for o in outcomes], indent=1))
    out.print(figures(outcomes))
    spent = np.array([o.seconds for o in outcomes])
    own, fixed = (sum(getattr(o, name) for o in outcomes) for name in ("stage_time", "fixed_time"))
    slower = max((o.stage_time / o.fixed_time for o in outcomes), default=1.0)
    out.print(f"stage time: {own / len(outcomes):.1f} s on average; fixed protocol 'rich' {RICH:g} s")
    out.print(
        f"fixed order with stopping: {fixed / len(outcomes):.1f} s on average; a drive was chosen in "
        f"{sum(o.chosen > 0 for o in outcomes)} stages; at worst {100 * (slower - 1):.0f} % slower than the fixed order"
    )
    out.print(f"processor time per stage: median {np.median(spent):.1f} s, longest {spent.max():.1f} s")


if __name__ == "__main__":
    main()
