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

"""The process of a live diagnosis: what it leaves beside the recording. No ROS."""

import time
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.effects import HYSTERESIS, Arx, Offset
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.identification.live_process import LiveProcess, LiveSettings
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.report.json_file import read_json

STROKE = 4e-5
"""Largest displacement of the stage [m]."""
FIRST_GROUP_ONLY = 15.0
"""Stage time into which no second group of phases fits [s]."""


def next_message(process):
    while (message := process.poll()) is None:
        time.sleep(0.05)
    return message


def test_data_that_allow_no_verdict_leave_an_answer_with_the_probabilities(tmp_path):
    """A sensor that reaches the end of its range: the driven time is not lost, because the reason is written."""
    stage = Model((HYSTERESIS(), Arx(), Offset()), 1e-4)
    path = tmp_path / "experiment"
    process = LiveProcess(path, DriveLimits(1e-4), LiveSettings(0.005, FIRST_GROUP_ONLY, 0))
    try:
        due = next_message(process)
        records, clock = [], 0.0
        for phase in due.phases:
            record = phase.as_record(clock)
            (displacement,) = stage.simulate(record)
            records.append(replace(record, displacement=displacement))
            clock += phase.duration
        largest = max(r.displacement.max() for r in records)
        clipped = [replace(r, displacement=STROKE * np.minimum(r.displacement / largest, 0.6)) for r in records]
        recording.write(Experiment(tuple(clipped)), path)
        process.played(due.phases)
        assert not next_message(process).phases
        with pytest.raises(IdentificationError, match=r"No verdict is possible.*clipped at"):
            next_message(process)
    finally:
        process.close()
    answer = read_json(path / "answer.json")
    assert answer["conclusion"] == "insufficient_data"
    assert answer["model"] == ""
    assert answer["live"]["stage_time_s"] == pytest.approx(clock)
    assert sum(answer["live"]["probabilities"][-1]["probabilities"].values()) == pytest.approx(1.0)
