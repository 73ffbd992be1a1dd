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

"""``piezo record``: a lab without ROS plays a protocol to a stage and records it."""

import signal

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.acquisition.phase_recorder import record_phases
from piezo_hysteresis.acquisition.session import DriverSession
from piezo_hysteresis.cli.stage import record, safe_session
from piezo_hysteresis.errors import StageError

pytestmark = pytest.mark.device

STAGE = """
/**:
  ros__parameters:
    stage: simulated
    sample_period: 1.0e-4
    real_time_factor: 20.0
    block_duration: 0.05
    simulated:
      seed: 3
      memory: {memory}
      environment.thermometer: 1
"""


@pytest.mark.parametrize("memory", ["false", "true"])
def test_a_protocol_is_recorded_phase_by_phase(piezo, tmp_path, memory):
    file, folder = tmp_path / "stage.yaml", tmp_path / "experiment"
    file.write_text(STAGE.format(memory=memory))
    done = piezo("record", file, "short", "-o", folder)
    assert done.status == 0, done.err
    assert "largest slew" in done.out, "shown before anything moves"
    planned = tmp_path / "planned"
    assert piezo("simulate", "--protocol", "short", "--sample-period", 1e-4, "--seed", 0, "-o", planned).status == 0
    got, expected = recording.read(folder).records, recording.read(planned).records
    assert list(dict.fromkeys(r.phase for r in got)) == list(dict.fromkeys(r.phase for r in expected))
    assert memory == "true" or [r.phase for r in got] == [r.phase for r in expected]
    played, planned_voltage = (np.concatenate([r.voltage for r in records]) for records in (got, expected))
    np.testing.assert_allclose(played, planned_voltage, atol=1e-3)
    assert all(record.continues for record in got[1:])
    assert not got[0].continues
    assert all(record.channels["temperature"].size == record.size for record in got)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("stage: simulated", "expected a parameter file of the driver"),
        ("/**:\n  ros__parameters:\n    speed: 1.0\n", "speed is no parameter of the driver"),
        ("/**:\n  ros__parameters:\n    stage: toaster\n", "got 'toaster', expected one of "),
        ("/**:\n  ros__parameters:\n    stage: gcs2\n    gcs2: {host: nowhere}\n", "max_slew_rate: got 0 V/s"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_in_one_line(piezo, tmp_path, text, reason):
    file = tmp_path / "stage.yaml"
    file.write_text(text)
    done = piezo("record", file, "short", "-o", tmp_path / "experiment")
    assert done.status == 2
    assert reason in done.err
    assert done.err.count("\n") == 1


@pytest.mark.parametrize("error", [KeyboardInterrupt, StageError("the link was lost")])
def test_what_is_complete_is_written_when_a_later_phase_ends_early(piezo, tmp_path, monkeypatch, error):
    file, folder = tmp_path / "stage.yaml", tmp_path / "experiment"
    file.write_text(STAGE.format(memory="false"))
    begun = []

    def interrupted(session, phases, progress, keep):
        def begins(name):
            begun.append(name)
            if len(begun) == 3:
                raise error

        return record_phases(session, phases, begins, keep)

    monkeypatch.setattr(record, "record_phases", interrupted)
    done = piezo("record", file, "short", "-o", folder)
    assert done.status == (130 if error is KeyboardInterrupt else 2)
    got = recording.read(folder).records
    assert [r.phase for r in got] == begun[:2]
    assert "wrote 2 records of 2 complete phases" in done.out + done.err


@pytest.mark.parametrize("place", ["full", "file/experiment"])
def test_a_place_that_cannot_be_written_is_refused_before_anything_moves(piezo, tmp_path, monkeypatch, place):
    file = tmp_path / "stage.yaml"
    file.write_text(STAGE.format(memory="false"))
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "old").touch()
    (tmp_path / "file").touch()
    monkeypatch.setattr(safe_session, "DriverSession", lambda *_: pytest.fail("the stage was opened"))
    done = piezo("record", file, "short", "-o", tmp_path / place)
    assert done.status == 2
    assert place.split("/")[0] in done.err


def test_ctrl_c_brings_the_stage_to_safety_with_a_message(piezo, tmp_path, monkeypatch):
    file, folder = tmp_path / "stage.yaml", tmp_path / "experiment"
    file.write_text(STAGE.format(memory="false"))
    sessions = []

    def interrupted(session, phases, progress, keep):
        sessions.append(session)
        return record_phases(session, phases, lambda name: signal.raise_signal(signal.SIGINT), keep)

    monkeypatch.setattr(record, "record_phases", interrupted)
    done = piezo("record", file, "short", "-o", folder)
    assert done.status == 130
    assert done.err.strip().endswith("is at its safe voltage, 0 V; nothing was written")
    assert sessions[0].stage.voltage == 0.0
    assert not folder.exists()


def test_another_ctrl_c_does_not_lose_the_phases_that_are_written(piezo, tmp_path, monkeypatch):
    file, folder = tmp_path / "stage.yaml", tmp_path / "experiment"
    file.write_text(STAGE.format(memory="false"))
    write = recording.write

    def interrupted(session, phases, progress, keep):
        return record_phases(session, phases, lambda name: name == "noise" and signal.raise_signal(signal.SIGINT), keep)

    def interrupted_again(*arguments):
        signal.raise_signal(signal.SIGINT)
        write(*arguments)

    monkeypatch.setattr(record, "record_phases", interrupted)
    monkeypatch.setattr(recording, "write", interrupted_again)
    done = piezo("record", file, "short", "-o", folder)
    assert done.status == 130
    assert f"complete phases to {folder}" in done.err.replace("\n", "")
    assert recording.read(folder)[0].phase == "conditioning"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_more_signals_on_the_way_to_safety_are_ignored(piezo, tmp_path, monkeypatch, number):
    file = tmp_path / "stage.yaml"
    file.write_text(STAGE.format(memory="false"))
    sessions, make_safe = [], DriverSession.make_safe

    def signalled(session):
        sessions.append(session)
        signal.raise_signal(number)
        make_safe(session)

    def interrupted(session, phases, progress, keep):
        return record_phases(session, phases, lambda name: name == "noise" and signal.raise_signal(number), keep)

    before = signal.getsignal(number)
    monkeypatch.setattr(DriverSession, "make_safe", signalled)
    monkeypatch.setattr(record, "record_phases", interrupted)
    done = piezo("record", file, "short", "-o", tmp_path / "experiment")
    assert done.status == 130
    assert "is at its safe voltage, 0 V" in done.err
    assert sessions[0].stage.voltage == 0.0
    assert signal.getsignal(number) is before
