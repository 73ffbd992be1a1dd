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

"""A small experiment on disk, and the command line in this process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.cli.main import main
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.stage.simulated import SimulatedStage


@dataclass(frozen=True)
class Outcome:
    status: int
    out: str
    err: str


@pytest.fixture
def piezo(capsys):
    """Run the command line; words as in a shell."""

    def run(*words: object) -> Outcome:
        try:
            status = main([str(word) for word in words])
        except SystemExit as error:  # argparse
            status = int(error.code or 0)
        captured = capsys.readouterr()
        return Outcome(status, captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """Step, noise, triangle and validation of the simulated stage, as NPZ files."""
    limits = DriveLimits()
    stage = SimulatedStage(seed=2)
    drives = (
        ("rest", excitation.hold(limits, 0.0, 0.1), 1),
        ("step", excitation.steps(limits, (0.2, 0.8) * 3, 0.005), 1),
        ("noise", excitation.noise(limits, 0.012, 10e3, 0.2, centre=0.35, seed=1), 1),
        ("triangle", excitation.triangle(limits, (1.0, 0.5), 2.0), 25),
        ("sine_50hz", excitation.sine(limits, 50.0, 0.06), 1),
        ("validation", excitation.mixture(limits, 0.2, 4), 1),
    )
    records = [
        stage.play(limits.from_safe_to_safe(drive), name, continues=i > 0, average=average)
        for i, (name, drive, average) in enumerate(drives)
    ]
    path = tmp_path_factory.mktemp("cli") / "experiment"
    recording.write(Experiment(tuple(records)), path)
    return path
