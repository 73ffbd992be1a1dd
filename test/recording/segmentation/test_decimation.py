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

"""A bag that says which of its phases are slow is read like that, unless the reader says otherwise."""

import numpy as np
import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write
from piezo_hysteresis.recording.segmentation.decimation import FILE, load_decimation, save_decimation


def test_slow_phases_are_averaged_on_reading(tmp_path):
    voltage = np.arange(100.0)
    records = [Record(voltage, 1e-6 * voltage, 1e-3, phase=name) for name in ("triangle", "step")]
    write(Experiment(tuple(records)), tmp_path / "run", format="rosbag2")
    assert load_decimation(tmp_path / "run") == {}
    save_decimation(tmp_path / "run", [("triangle", 10)])
    triangle, step = read(tmp_path / "run")
    assert (triangle.sample_period, step.sample_period) == (1e-2, 1e-3)
    np.testing.assert_array_equal(triangle.voltage, voltage.reshape(10, 10).mean(axis=1))
    assert [r.size for r in read(tmp_path / "run", decimate={})] == [100, 100]


def test_no_phase_is_averaged_more_than_planned_because_of_another_of_its_name(tmp_path):
    planned = [("rest", 50), ("step", 1), ("rest", 500), ("sine_1hz", 5)]
    save_decimation(tmp_path, planned)
    assert load_decimation(tmp_path) == {"rest": 50, "step": 1, "sine_1hz": 5}


def run_of(folder, *sizes):
    """A bag of phases `rest` of these sizes, of which 10 samples are averaged into one, and a phase `step`."""
    records = []
    for name, size in [*(("rest", n) for n in sizes), ("step", 100)]:
        voltage = np.arange(float(size))
        records.append(Record(voltage, 1e-6 * voltage, 1e-3, name, continues=bool(records)))
    write(Experiment(tuple(records)), folder)
    save_decimation(folder, [("rest", 10)])
    return folder


@pytest.mark.parametrize("sizes", [(100, 9), (9, 100)])
def test_a_piece_too_short_to_average_is_left_out_and_the_others_are_read(tmp_path, sizes):
    experiment = read(run_of(tmp_path / "run", *sizes))
    assert [(r.phase, r.size) for r in experiment] == [("rest", 10), ("step", 100)]
    (notice,) = (n for n in experiment.notices if n.kind == "left_out")
    assert notice.phase == "rest" and notice.message.startswith("a record of 9 samples was left out")


def test_no_state_is_carried_to_a_record_whose_beginning_was_left_out(tmp_path):
    later = read(run_of(tmp_path / "a"), run_of(tmp_path / "b", 9))[1]
    assert later.truncated and not later.continues


def test_a_recording_of_which_nothing_is_left_is_refused_with_the_reason(tmp_path):
    record = Record(np.zeros(9), np.zeros(9), 1e-3, "rest")
    write(Experiment((record,)), tmp_path / "run")
    with pytest.raises(RecordingError, match="a record of 9 samples was left out, because 10 are averaged"):
        read(tmp_path / "run", decimate={"rest": 10})


@pytest.mark.parametrize("text", ["- 1", "triangle: 0", "triangle: ten", "[", "\xff"])
def test_a_broken_file_is_reported(tmp_path, text):
    (tmp_path / FILE).write_text(text, encoding="latin-1")
    with pytest.raises(RecordingError, match="expected phase names and whole numbers"):
        load_decimation(tmp_path)
