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

"""``piezo diagnose --stage``: the gap finder plays phases to a stage, and stops when the answer is certain."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ... import recording
from ...acquisition.phase_recorder import record_phases
from ...acquisition.session import DriverSession
from ...acquisition.settings import DriverSettings
from ...discrepancy.choice.live_diagnosis import LiveDiagnosis, begin
from ...discrepancy.choice.time_to_decide import ERROR_RATE, LONGEST
from ...errors import ParameterError, counted
from ...home_path import in_home
from ...identification.protocol.protocol import Protocol
from ...record import Experiment, Record
from ...report.tables.probability_table import probability_table
from ...stage.back_ends import BACK_ENDS
from ...yaml_file import read_yaml
from ..stage.record import checked_settings, drive_limits, read_stage
from ..stage.safe_session import safe_session, uninterrupted
from ..terminal import console, progress, show
from .destination import require_new_experiment
from .whole_number import whole_number

FASTEST = 1000.0
"""Speed of a stage given only by a file of plant parameters; 1 is real time."""


def add_stage_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--stage``, ``--error-rate``, ``--stage-time`` and ``--seed``."""
    group = parser.add_argument_group("drive a stage during the diagnosis, instead of reading a recording")
    group.add_argument(
        "--stage",
        metavar="FILE",
        help="stage to drive: file of plant parameters of a simulated one, or parameter file of the driver",
    )
    group.add_argument(
        "--error-rate",
        type=float,
        default=ERROR_RATE,
        metavar="P",
        help=f"accepted probability of a wrong answer (default: {ERROR_RATE:g})",
    )
    group.add_argument(
        "--stage-time",
        type=float,
        default=LONGEST,
        metavar="S",
        help=f"longest time for which the stage is driven [s] (default: {LONGEST:g})",
    )
    group.add_argument("--seed", type=whole_number, default=0, help="seed of the random waveforms (default: 0)")


def diagnose_stage(args: argparse.Namespace) -> LiveDiagnosis:
    """Play, record and decide until the answer is certain. The recording is written also after an error.

    Parameters
    ----------
    args : Namespace
        Of ``piezo diagnose``.

    Raises
    ------
    PiezoError
        If a file, a stage, limits or a folder is not acceptable. The stage is then at its safe voltage.
    """
    if args.output is None:
        raise ParameterError("diagnose --stage: got no -o, expected the folder of the experiment to write")
    require_new_experiment("-o", args.output)
    path = in_home(args.stage)
    settings, values = _settings(path)
    records: list[Record] = []
    try:
        with safe_session(settings, values, f"a recording with {path.resolve()}") as session:
            live = begin(
                drive_limits(session),
                error_rate=args.error_rate,
                longest=args.stage_time,
                seed=args.seed,
            )
            _show_plan(session, live)
            started = time.monotonic()
            with progress("diagnose") as report_progress:
                while live.due:
                    report_progress(f"playing {live.due_name}", live.time / live.longest)
                    before = _clock(session, records, started)
                    _play(session, live, records, before)
                    live = live.advanced(Experiment(tuple(records)), report_progress)
                    console().print(f"{live.updates[-1].time:6.1f} s: {live.updates[-1].sentence()}", highlight=False)
    finally:
        if records:
            with uninterrupted():
                recording.write(Experiment(tuple(records)), args.output)
            console().print(f"wrote {counted(len(records), 'phase')} to {args.output}")
    show(probability_table(live.answer()))
    return live


def _settings(path: Path) -> tuple[DriverSettings, dict[str, Any]]:
    """Those of the stage of a parameter file of the driver, or of a simulated one of plant parameters."""
    content = read_yaml(path)
    nodes = content if isinstance(content, Mapping) else {}
    if "/**" in nodes or any(isinstance(node, Mapping) and "ros__parameters" in node for node in nodes.values()):
        return read_stage(path)
    given = {"stage": "simulated", "simulated.plant_file": str(path), "real_time_factor": FASTEST}
    return checked_settings(given, path)


def _show_plan(session: DriverSession, live: LiveDiagnosis) -> None:
    """Print the phases that may be played, before the stage moves."""
    out = console()
    whole = Protocol("plan", live.limits, tuple(p for tier in live.plan for p in tier.phases))
    out.print(f"{session.limits.name}\nplan: {whole.summary}", highlight=False)
    for number, tier in enumerate(live.plan, 1):
        names = ", ".join(dict.fromkeys(p.name for p in tier.phases))
        out.print(f"  {number}. {tier.name}: {tier.duration:.1f} s ({names})", highlight=False)
    out.print(
        f"  It stops as soon as the answer is certain at an error rate of {100 * live.error_rate:g} %. If several "
        f"explanations remain, further drives inside the same limits may follow, up to {live.longest:g} s in all.",
        highlight=False,
    )


def _play(session: DriverSession, live: LiveDiagnosis, records: list[Record], start: float) -> None:
    """Play the phases that are due, and append the complete ones to `records`, on the clock of the experiment."""

    def keep(phase: list[Record]) -> None:
        before = bool(records)
        records.extend(replace(r, start_time=r.start_time + start, continues=r.continues or before) for r in phase)

    record_phases(session, ((p.name, p.voltage, p.stored_every) for p in live.due), keep=keep)


def _clock(session: DriverSession, records: list[Record], started: float) -> float:
    """Time at which the next phase begins [s]. The time of a simulated stage does not pass between phases."""
    if not records:
        return 0.0
    end = records[-1].start_time + records[-1].duration
    return time.monotonic() - started if BACK_ENDS[session.settings.stage].is_device else end
