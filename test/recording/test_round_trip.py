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

"""What is written is what is read, in every format that can be written: samples to the last bit."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write

numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
starts = st.floats(-1200.0, 1200.0, allow_subnormal=False)  # [V]; others are refused unless they were recorded, too
periods = st.sampled_from([2e-6, 2e-5, 1e-4, 5e-3, 0.1]) | st.floats(1e-6, 1.0)
names = st.sampled_from(["rest", "step", "sine_50hz", "my phase", 'a "b", c', "µ/x"])


@st.composite
def experiments(draw, periods=periods, names=names, shortest=1):
    """Records that begin anew, follow without a gap, or follow after a hold or lost samples."""
    records = []
    end = 0.0
    for k in range(draw(st.integers(1, 3))):
        n, period = draw(st.integers(shortest, 30)), draw(periods)
        follows = bool(records) and draw(st.booleans())
        silent = draw(st.integers(0, 1000)) * period if follows else draw(st.floats(0.0, 100.0))
        records.append(
            Record(
                draw(arrays(float, n, elements=numbers)),
                draw(arrays(float, n, elements=numbers)),
                period,
                phase=draw(names),
                start_time=end + (silent if k else 0.0),
                continues=follows,
                truncated=follows and silent > 0.0 and draw(st.booleans()),
                initial_voltage=None if follows else draw(st.none() | starts),
            )
        )
        end = records[-1].start_time + records[-1].duration
    return Experiment(tuple(records))


@pytest.mark.parametrize("ending", [".csv", ".mat", ""])
def test_a_part_that_begins_in_motion_is_not_taken_for_one_at_rest(tmp_path, ending):
    """Tables lost that it continues something, and its state was taken for known."""
    drive = np.sin(np.arange(500) / 20.0)
    part = Experiment((Record(drive, 1e-6 * drive, 1e-3, "sine", start_time=2.0, continues=True),))
    write(part, tmp_path / f"part{ending}")
    (found,) = read(tmp_path / f"part{ending}")
    assert found.truncated
    assert not found.continues


@pytest.mark.parametrize("ending", [".csv", ".mat", ""])
def test_phases_with_any_name_are_read_back(tmp_path, ending):
    """A last phase whose name is a number made the rows of the others text above the table."""
    drive = np.sin(np.arange(300) / 20.0)
    names, sent = ("sine", "50", ""), []
    for k, name in enumerate(names):
        sent.append(Record(drive, 1e-6 * drive, 1e-3, name, start_time=10.0 * k))
    write(Experiment(tuple(sent)), tmp_path / f"e{ending}")
    got = read(tmp_path / f"e{ending}")
    assert [r.phase for r in got] == ["sine", "50", "record"]
    assert [r.size for r in got] == [300, 300, 300]


def assert_same(got, sent, but=()):
    assert len(got) == len(sent)
    for a, b in zip(got, sent, strict=True):
        np.testing.assert_array_equal(a.voltage, b.voltage)
        np.testing.assert_array_equal(a.displacement, b.displacement)
        for name in {"sample_period", "phase", "start_time", "continues", "truncated", "initial_voltage"} - set(but):
            assert getattr(a, name) == getattr(b, name), name


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
@settings(max_examples=40)
@given(experiment=experiments())
def test_files_come_back_exactly(name, experiment):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(experiment, path)
        assert_same(read(path), experiment)


@settings(max_examples=25)
@given(
    experiment=experiments(
        periods=st.sampled_from([2e-6, 2e-5, 1e-4, 5e-3, 0.1]),
        names=st.sampled_from(["rest", "step", "sine_50hz"]),
        shortest=2,  # a single sample has no period
    )
)
def test_a_written_bag_reads_back_exactly(experiment):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        write(experiment, path, format="rosbag2")
        got = read(path)
    assert_same(got, experiment, but=("initial_voltage", "start_time", "sample_period"))
    for a, b in zip(got, experiment, strict=True):
        assert a.sample_period == pytest.approx(b.sample_period, rel=1e-9)
        slowest = max(r.sample_period for r in experiment)
        assert a.start_time == pytest.approx(b.start_time, abs=2.01 * len(experiment) * slowest)
        assert b.continues or a.initial_voltage == b.settled_voltage


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
def test_optional_channels_and_flags_come_back(tmp_path, name):
    random = np.random.default_rng(0)
    records = tuple(
        Record(
            *random.normal(size=(2, 50)),
            2e-5,
            "noise",
            start_time=k * 50 * 2e-5,
            truncated=k == 0,
            channels={
                "other_displacement": random.normal(size=50),
                "temperature": random.normal(size=50) + 293.0,
                "displacement_3": random.normal(size=50),
                "monitor_voltage": random.normal(size=50),
            },
        )
        for k in range(3)
    )
    write(Experiment(records), tmp_path / name)
    got = read(tmp_path / name)
    assert_same(got, records)
    for a, b in zip(got, records, strict=True):
        assert a.channels.keys() == b.channels.keys()
        for name, values in b.channels.items():
            np.testing.assert_array_equal(a.channels[name], values)
        np.testing.assert_array_equal(a.channels["other_displacement"], b.channels["other_displacement"])
        np.testing.assert_array_equal(a.channels["temperature"], b.channels["temperature"])


@pytest.mark.parametrize("period", [1e-3, 2e-3])
def test_a_bag_keeps_holds_lost_samples_and_unknown_states(tmp_path, period):
    u = np.linspace(0.0, 5.0, 200)

    def record(start, **labels):
        return Record(u, 1e-6 * u, period if start else 1e-3, f"phase_{start:g}", start, **labels)

    records = (
        record(0.0),
        record(60.0, continues=True),
        record(61.0, continues=True, truncated=True),
        record(70.0, truncated=True),
        record(80.0, initial_voltage=2.0),
    )
    write(Experiment(records), tmp_path / "bag.mcap")
    got = read(tmp_path / "bag")
    assert_same(got, records, but=("initial_voltage", "start_time"))
    np.testing.assert_allclose([r.start_time for r in got], [r.start_time for r in records], atol=1e-9)
    assert [n.phase for n in got.notices if n.kind == "truncated"] == ["phase_61", "phase_70"]
    (slow, *_) = read(tmp_path / "bag", decimate={"phase_60": 10}).named("phase_60")
    assert (slow.size, slow.start_time, slow.truncated) == (20, pytest.approx(60.0), False)


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
def test_a_channel_that_not_every_record_has_comes_back(tmp_path, name):
    u = np.linspace(0.0, 5.0, 200)
    warm = {"temperature": 293.0 + u}
    records = (Record(u, u, 1e-3, "a"), Record(u, u, 1e-3, "b", 0.2, continues=True, channels=warm))
    write(Experiment(records), tmp_path / name)
    got = read(tmp_path / name)
    assert_same(got, records)
    assert not got[0].channels
    np.testing.assert_array_equal(got[1].channels["temperature"], warm["temperature"])


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
@pytest.mark.parametrize("number", [np.float64, np.float32, np.asarray])
def test_a_start_that_was_taken_from_an_array_comes_back(tmp_path, name, number):
    """A CSV file contained `np.float64(1.5)` and could not be read."""
    start = {"start_time": number(2.0**31), "initial_voltage": number(1.5)}
    sent = Record([1.0, 2.0, 1.0], [0.0, 1e-6, 0.0], 1e-3, "triangle", **start)
    write(Experiment((sent,)), tmp_path / name)
    (got,) = read(tmp_path / name)
    assert (got.start_time, got.initial_voltage) == (2.0**31, 1.5)


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
def test_times_that_count_from_an_epoch_come_back(tmp_path, name):
    u = np.linspace(0.0, 5.0, 200)
    begin = 1.7e9
    records = tuple(Record(u, u, 2e-5, f"step_{k}", begin + 0.2 * k) for k in range(3))
    write(Experiment(records), tmp_path / name)
    assert_same(read(tmp_path / name), records)


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat", "bag.mcap"])
def test_what_cannot_be_written_completely_leaves_no_file(tmp_path, name):
    u = np.linspace(0.0, 5.0, 20_000)
    few, many = Record(u[:9], u[:9], 1e-3, "a"), Record(u, u, 1e-3, "b")
    code = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "from piezo_hysteresis.recording import read, write\n"
        "experiment = read(sys.argv[1])\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "write(experiment, sys.argv[2])"
    )
    write(Experiment((few, many)), tmp_path / "whole")
    place = tmp_path / "full" / name
    place.parent.mkdir()
    command = [sys.executable, "-c", code, str(tmp_path / "whole"), str(place)]
    failed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "RecordingError" in failed.stderr
    assert ("the recording ended" if name == "bag.mcap" else "expected a f") in failed.stderr
    assert not [path for path in place.parent.rglob("*") if path.is_file()]


@pytest.mark.parametrize(("first", "second"), [(1e-4, 1e-2), (1e-2, 1e-4)])
def test_a_bag_keeps_an_unknown_state_at_another_sample_period(tmp_path, first, second):
    u = np.linspace(0.0, 5.0, 200)
    records = (Record(u, u, first, "a"), Record(u, u, second, "b", 200 * first, truncated=True))
    write(Experiment(records), tmp_path / "bag.mcap")
    got = read(tmp_path / "bag")
    assert_same(got, records, but=("initial_voltage", "start_time"))
    assert got[1].start_time == pytest.approx(200 * first, abs=first)


def test_phases_are_averaged_on_reading_on_request(tmp_path):
    record = Record(np.arange(100.0), np.arange(100.0), 1e-3, "rest", initial_voltage=7.0)
    write(Experiment((record,)), tmp_path / "e")
    (slow,) = read(tmp_path / "e", decimate={"rest": 10})
    assert (slow.size, slow.sample_period, slow.initial_voltage) == (10, 0.01, 7.0)
    np.testing.assert_array_equal(slow.voltage, np.arange(10) * 10 + 4.5)


def test_a_bag_can_contain_a_third_axis(tmp_path):
    voltage = 3.5 + 2.5 * np.sin(2 * np.pi * 10 * np.arange(400) * 1e-3)
    third = {"displacement_3": 1e-7 * voltage, "temperature": 293.0 + 0.1 * voltage}
    record = Record(voltage, 1e-6 * voltage, 1e-3, "sine_10hz", channels=third)
    write(Experiment((record,)), tmp_path / "bag.mcap")
    (got,) = read(tmp_path / "bag")
    assert set(got.channels) == set(third)
    for name, values in third.items():
        np.testing.assert_array_equal(got.channels[name], values)


def test_a_third_axis_of_a_foreign_table_is_named_by_a_column(tmp_path):
    rows = np.column_stack((np.arange(400) * 1e-3, np.sin(np.arange(400.0)), np.arange(400.0), np.arange(400.0) / 7))
    np.savetxt(
        tmp_path / "t.csv", rows, delimiter=",", header="Time [s],Drive [V],Sensor [um],Axis 3 [nm]", comments=""
    )
    (got,) = read(tmp_path / "t.csv", columns={"displacement_3": "Axis 3 [nm]"}, phases="x")
    np.testing.assert_allclose(got.channels["displacement_3"], rows[:, 3] * 1e-9, rtol=1e-12)


@pytest.mark.parametrize("name", ["folder", "table.csv", "matlab.mat"])
def test_options_that_would_have_no_effect_are_refused(tmp_path, name):
    path = tmp_path / name
    write(Experiment((Record(np.arange(20.0), 1e-6 * np.arange(20.0), 1e-3, "step"),)), path)
    with pytest.raises(RecordingError, match="`axis`: got '/stage_x', expected none; only a bag has namespaces"):
        read(path, axis="/stage_x")
    with pytest.raises(RecordingError, match="`include`: got 'rest', expected some of idle, hold"):
        read(path, include=("rest",))
