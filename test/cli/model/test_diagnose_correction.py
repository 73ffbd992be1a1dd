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

"""`piezo diagnose --correction`: a correction without a name is written only if accepted, and is in the answer."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis.cli.model import diagnose as command
from piezo_hysteresis.discrepancy import Conclusion, Diagnosis, Gap
from piezo_hysteresis.discrepancy.unnamed.correction import Correction
from piezo_hysteresis.effects import Arx, BoucWen, UnnamedPositionMap
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

ENVELOPE = {"voltage_min": "0", "voltage_max": "8", "frequency_min": "1", "frequency_max": "30", "slew_rate_max": "900"}
PLAIN = Model((BoucWen(), Arx(b=[0.3])), 1e-3, displacement_scale=1e-5, provenance=ENVELOPE)
HUMP = UnnamedPositionMap(m=(0.001, 0.003, 0.001), low=0.0, high=0.5)
GAP = Gap(before=0.4, after=0.1, floor=0.05, interval_95=(0.1, 0.1), per_phase=(), unseen=True, live=0.1)
ACCEPTED = Correction(HUMP, 1e-5, PLAIN.with_effect(HUMP), 1.2, 0.9, GAP, 0.85, "")


def answered(correction: Correction, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, Path]:
    """The exit code of the command for a diagnosis with this correction, and the file that was asked for."""
    record = Record(np.sin(np.arange(9.0)), 1e-6 * np.arange(9.0), 1e-3, phase="sine_1hz")
    experiment = Experiment((record,))
    reason = "Something is missing."
    found = Diagnosis(Conclusion.UNEXPLAINED_GAP, reason, PLAIN, PLAIN, experiment, correction=correction)
    monkeypatch.setattr(command, "diagnose", lambda *_, **__: found)
    monkeypatch.setattr(command.reading_options, "read", lambda _: found.experiment)
    monkeypatch.setenv("COLUMNS", "300")
    parser, path = argparse.ArgumentParser(), tmp_path / "corrected.yaml"
    command.add_parser(parser.add_subparsers())
    options = ["--correction", path, "--json", tmp_path / "answer.json", "-o", tmp_path / "better.yaml"]
    args = parser.parse_args(["diagnose", "recording", *map(str, options)])
    return args.run(args), path


def test_an_accepted_correction_is_written_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, path = answered(ACCEPTED, tmp_path, monkeypatch)
    out, answer = capsys.readouterr().out, json.loads((tmp_path / "answer.json").read_text())
    assert code == 0
    assert model_file.load(path)[HUMP.name] == HUMP
    assert HUMP.name not in model_file.load(tmp_path / "better.yaml"), "the model of the answer stays without it"
    assert "removes 85 % of the gap" in out and "from 0 to 8 V" in out and str(path) in out
    assert answer["verdict"] == "unknown" and answer["effects"] == []
    assert answer["unnamed_correction"]["form"] == "unnamed_position_map"
    assert answer["unnamed_correction"]["shape"]["y"]["values"] == pytest.approx([0.0, 1e-8, 3e-8, 1e-8, 0.0])


def test_a_refused_correction_is_reported_and_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = replace(ACCEPTED, model=None, refusal="it removes 12 % of the gap on the test records")
    _, path = answered(refused, tmp_path, monkeypatch)
    assert "refused: it removes 12 %" in capsys.readouterr().out
    assert not path.exists()
