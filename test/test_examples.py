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

"""The examples that need no stage."""

import ast
import runpy
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import yaml

from piezo_hysteresis import recording
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.hidden import hidden_effect
from piezo_hysteresis.stage.plant import PlantParameters

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_simulate(capsys):
    runpy.run_path(str(EXAMPLES / "simulate.py"))
    assert capsys.readouterr().out == "25000 samples, stroke 20.392 µm\n"


def test_read_experiment(tmp_path, capsys, monkeypatch):
    record = Record([0.0, 1.0, 2.0], [0.0, 1e-6, 2.5e-6], 1e-3, phase="triangle")
    recording.write(Experiment((record,)), tmp_path / "experiment")
    monkeypatch.setattr(sys, "argv", ["read_experiment.py", str(tmp_path / "experiment")])
    runpy.run_path(str(EXAMPLES / "read_experiment.py"))
    (line,) = capsys.readouterr().out.splitlines()
    assert line.split(maxsplit=1)[0] == "triangle"
    assert line.endswith("3 samples of 1000 µs, 0.00 to 2.00 V, 0.000 to 2.500 µm")


def test_hide_effect_prints_no_answer_and_writes_the_plant_of_the_seed(tmp_path):
    command = [sys.executable, EXAMPLES / "hide_effect.py", "3", tmp_path / "plant.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""
    written = PlantParameters.from_mapping(yaml.safe_load((tmp_path / "plant.yaml").read_text()))
    assert written.full_stroke != PlantParameters().full_stroke
    assert written == hidden_effect(3, written).parameters


def test_own_stage(capsys):
    runpy.run_path(str(EXAMPLES / "own_stage.py"), run_name="__main__")
    assert capsys.readouterr().out == "50 samples, 23.5 µm, 0 V at the end\n"


def test_own_stage_keeps_its_slew_limit_in_real_time():
    """After a delay it caught up with samples that had no time between them."""
    slew, put, delays = 100.0, [], iter([0.1])

    def get():
        if len(put) == 20:
            time.sleep(next(delays, 0.0))
        return 0.0

    own_stage = runpy.run_path(str(EXAMPLES / "own_stage.py"))["OwnStage"]
    stage = own_stage("bench 3", lambda volts: put.append((time.monotonic(), volts)), get, 10.0, slew)
    stage.exchange(np.arange(1, 121) * 0.5 * slew * stage.sample_period)
    stage.close()
    at, voltage = np.array(put).T
    assert voltage.max() == 6.0
    assert (np.abs(np.diff(voltage)) <= slew * np.diff(at) + 1e-9).all()


def test_ten_lines_send_a_scan():
    body = ast.parse((EXAMPLES / "send_scan.py").read_text()).body
    lines = [node for node in body if not isinstance(node, ast.Import | ast.ImportFrom)][1:]  # without the docstring
    assert sum((node.end_lineno or 0) - node.lineno + 1 for node in lines) == 10
