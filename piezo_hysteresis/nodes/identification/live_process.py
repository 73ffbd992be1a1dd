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

"""`LiveProcess`: makes the decisions of a live diagnosis in its own process, so that the node can answer. No ROS."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...discrepancy.choice.live_diagnosis import LiveDiagnosis, begin
from ...errors import IdentificationError, RecordingError
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import ProtocolPhase
from ...model.model_file import dumps
from ...record import Experiment, Record
from ...recording import read
from ...report.json_file import write_json
from ..runtime.fit_process import Outcome
from ..runtime.job_process import Exchange, JobProcess, Report

PATIENCE = 20.0
"""Longest wait until the recorded samples are in the file [s]."""
_INTERVAL = 0.3
"""Time between two checks of the file [s]."""


@dataclass(frozen=True, slots=True)
class LiveSettings:
    """Settings of a live diagnosis, as for `LiveDiagnosis`."""

    error_rate: float
    longest: float
    seed: int

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> LiveSettings:
        """Settings from the parameters of the node."""
        return cls(values["error_rate"], values["stage_time"], values["seed"])


@dataclass(frozen=True, eq=False, slots=True)
class Due:
    """The phases to be played next, and the likeliest explanations so far.

    Parameters
    ----------
    name : str
        Short description of the phases.
    phases : tuple of ProtocolPhase
        Phases to be played; empty at the end.
    likely : str
        The likeliest explanations with their probabilities; empty before the first phases.
    """

    name: str
    phases: tuple[ProtocolPhase, ...]
    likely: str


class LiveProcess(JobProcess[Due | Outcome]):
    """One live diagnosis. Its process ends when this process ends.

    Parameters
    ----------
    path : Path
        The recording, which grows during the diagnosis.
    limits : DriveLimits
        Of the stage.
    settings : LiveSettings
        Of the user.
    """

    def __init__(self, path: Path, limits: DriveLimits, settings: LiveSettings) -> None:
        super().__init__("diagnosis", _decide, path, limits, settings)

    def played(self, phases: Sequence[ProtocolPhase]) -> None:
        """Report that these phases, the last ones of the recording, were played."""
        self.send((len(phases), phases[-1].duration))


def _decide(exchange: Exchange, path: Path, limits: DriveLimits, settings: LiveSettings) -> Outcome:
    live = begin(limits, error_rate=settings.error_rate, longest=settings.longest, seed=settings.seed)
    phases = 0
    while live.due:
        likely = live.updates[-1].sentence() if live.updates else ""
        exchange.send(Due(live.due_name, live.due, likely))
        count, last = exchange.receive()
        phases += count
        live = live.advanced(_recorded(path, phases, last, exchange.report), exchange.report)
    exchange.send(Due(live.due_name, live.due, live.updates[-1].sentence()))
    return _outcome(live, path)


def _recorded(path: Path, phases: int, last: float, report: Report) -> Experiment:
    """Wait until the recording holds all played phases, and read it.

    Raises
    ------
    RecordingError
        If the last samples do not reach the file.
    """
    report("reading", 0.0)
    deadline = time.monotonic() + PATIENCE
    while True:
        experiment = read(path)
        records = experiment.records
        if len(records) > phases or (len(records) == phases and _is_whole(records[-1], last)):
            return experiment
        if time.monotonic() > deadline:
            raise RecordingError(
                f"{path}: got {len(records)} phases, expected {phases}, the last of {last:.3g} s; is the disk full?"
            )
        time.sleep(_INTERVAL)


def _is_whole(record: Record, duration: float) -> bool:
    """Whether a phase of this duration [s] is complete, apart from the samples that averaging cuts off."""
    return record.duration > duration - 1.5 * record.sample_period


def _outcome(live: LiveDiagnosis, path: Path) -> Outcome:
    found = live.found
    if found is None:
        raise IdentificationError(live.reason())
    answer = found.answer("" if found.model is None else str(path / "diagnosis.yaml"))
    answer["live"] = live.answer()
    write_json(str(path / "answer.json"), answer)
    if found.model is None:
        raise IdentificationError(found.reason)
    summary = "\n".join((live.reason(), found.summary()))
    verdict = f"{found.verdict}: {live.reason()} {found.reason}"
    return Outcome(dumps(found.model), summary, verdict, conclusion=str(found.conclusion))
