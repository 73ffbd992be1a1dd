"""What is written is what is read, in every format that can be written: samples to the last bit."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write

numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
periods = st.sampled_from([2e-6, 2e-5, 1e-4, 5e-3, 0.1]) | st.floats(1e-6, 1.0)
names = st.sampled_from(["rest", "step", "sine_50hz", "my phase", 'a "b", c', "µ/x"])


@st.composite
def experiments(draw, periods=periods, names=names):
    records = []
    end = 0.0
    for k in range(draw(st.integers(1, 3))):
        n = draw(st.integers(1, 30))
        follows = bool(records) and draw(st.booleans())
        records.append(
            Record(
                draw(arrays(float, n, elements=numbers)),
                draw(arrays(float, n, elements=numbers)),
                draw(periods),
                phase=draw(names),
                start_time=end if follows or k == 0 else end + draw(st.floats(0.0, 100.0)),
                continues=follows,
                initial_voltage=None if follows else draw(st.none() | numbers),
            )
        )
        end = records[-1].start_time + records[-1].duration
    return Experiment(tuple(records))


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
        periods=st.sampled_from([2e-6, 2e-5, 1e-4, 5e-3]), names=st.sampled_from(["rest", "step", "sine_50hz"])
    )
)
def test_bags_come_back_exactly_as_what_one_driver_would_send(experiment):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        write(experiment, path, format="rosbag2")
        got = read(path)
    assert_same(got, experiment, but=("initial_voltage", "start_time", "sample_period"))
    for a, b in zip(got, experiment, strict=True):
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
            other_displacement=random.normal(size=50),
            temperature=random.normal(size=50) + 293.0,
        )
        for k in range(3)
    )
    write(Experiment(records), tmp_path / name)
    got = read(tmp_path / name)
    assert_same(got, records)
    for a, b in zip(got, records, strict=True):
        np.testing.assert_array_equal(a.other_displacement, b.other_displacement)
        np.testing.assert_array_equal(a.temperature, b.temperature)


def test_phases_are_averaged_on_reading_where_asked(tmp_path):
    record = Record(np.arange(100.0), np.arange(100.0), 1e-3, "rest", initial_voltage=7.0)
    write(Experiment((record,)), tmp_path / "e")
    (slow,) = read(tmp_path / "e", decimate={"rest": 10})
    assert (slow.size, slow.sample_period, slow.initial_voltage) == (10, 0.01, 7.0)
    np.testing.assert_array_equal(slow.voltage, np.arange(10) * 10 + 4.5)
