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

"""Large files: what is not wanted is never kept, and what is too long is averaged on the way, in bounded memory."""

import sys

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import io

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import read
from piezo_hysteresis.recording.segmentation import decimating_buffer
from piezo_hysteresis.recording.segmentation.decimating_buffer import DecimatingBuffer, shared_averages
from piezo_hysteresis.recording.table import column
from test.recording import long_recordings

PERIOD = 1e-4
ROWS = 60_000
VOLTAGE = np.round(5.0 - 5.0 * np.cos(2 * np.pi * 2.0 * PERIOD * np.arange(ROWS)), 6)
MICRONS = np.round(VOLTAGE + 0.1 * np.roll(VOLTAGE, 300), 6)
CSV = {"columns": {"voltage": 1, "displacement": 2}, "units": {"displacement": "um"}}
OPTIONS = {"sample_period": PERIOD, "phases": "record"}


@pytest.fixture(scope="module", params=["csv", "mat5", "mat73"])
def source(request, tmp_path_factory):
    """The same record as a table, as version 5 and as a matrix of version 7.3; and how to read it."""
    folder = tmp_path_factory.mktemp("large")
    matrix = np.stack((VOLTAGE, MICRONS), axis=1)
    if request.param == "csv":
        np.savetxt(folder / "r.csv", matrix, fmt="%.6f", delimiter=",")
        return folder / "r.csv", CSV
    columns = {"columns": {"voltage": "m[1]", "displacement": "m[2]"}, "units": CSV["units"]}
    if request.param == "mat5":
        io.savemat(folder / "r.mat", {"m": matrix})
    else:
        with h5py.File(folder / "r.mat", "w", userblock_size=512) as file:
            file.create_dataset("m", data=matrix.T, chunks=(1, 4096), compression="gzip")
    return folder / "r.mat", columns


def test_averaging_while_reading_is_decimation(source):
    path, options = source
    (averaged,) = read(path, average=7, **options, **OPTIONS)
    (whole,) = read(path, **options, **OPTIONS)
    decimated = whole.decimate(7)
    np.testing.assert_allclose(averaged.voltage, decimated.voltage, rtol=1e-12)
    np.testing.assert_allclose(averaged.displacement, decimated.displacement, rtol=1e-12)
    assert averaged.sample_period == pytest.approx(7 * PERIOD)


def test_a_part_is_the_same_as_that_part_of_the_whole(source):
    path, options = source
    (part,) = read(path, rows=(31_234, 50_001), **options, **OPTIONS)
    np.testing.assert_array_equal(part.voltage, VOLTAGE[31_234:50_001])
    assert part.truncated
    (last,) = read(path, rows=(-500, None), **options, **OPTIONS)
    np.testing.assert_array_equal(last.voltage, VOLTAGE[-500:])
    (third,) = read(path, rows=(3_000, 9_000), average=3, initial_voltage=0.0, **options, **OPTIONS)
    np.testing.assert_allclose(third.voltage, VOLTAGE[3_000:9_000].reshape(-1, 3).mean(axis=1), rtol=1e-12)
    assert not third.truncated
    with pytest.raises(RecordingError, match="60000 rows that is not empty"):
        read(path, rows=(70_000, 80_000), **options, **OPTIONS)


def test_every_sample_of_more_than_the_memory_is_meant_to_hold_is_refused_with_the_way_out(source, monkeypatch):
    path, options = source
    monkeypatch.setattr(decimating_buffer, "MOST", 50_000)
    with pytest.raises(RecordingError, match=r"more than 50000 samples.*`rows`, or a larger `average`"):
        read(path, average=1, **options, **OPTIONS)
    assert read(path, average=2, **options, **OPTIONS).size == ROWS // 2


def test_a_long_recording_is_averaged_by_as_little_as_it_takes_and_this_is_reported(source, monkeypatch):
    path, options = source
    (whole,) = read(path, average=4, **options, **OPTIONS)
    monkeypatch.setattr(decimating_buffer, "ENOUGH", 20_000)
    experiment = read(path, **options, **OPTIONS)
    assert [n.kind for n in experiment.notices if n.kind == "averaged"] == ["averaged"]
    (record,) = experiment
    assert record.sample_period == pytest.approx(4 * PERIOD)
    np.testing.assert_allclose(record.voltage, whole.voltage, rtol=1e-12)
    np.testing.assert_allclose(record.displacement, whole.displacement, rtol=1e-12)


@given(
    sizes=st.lists(st.integers(0, 70), max_size=30),
    average=st.one_of(st.none(), st.integers(1, 9)),
    start=st.integers(0, 50),
    length=st.one_of(st.none(), st.integers(0, 300)),
)
def test_pieces_of_any_size_come_to_the_same_as_all_at_once(sizes, average, start, length):
    values = np.random.default_rng(1).normal(size=(sum(sizes), 2))
    stop = None if length is None else start + length
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decimating_buffer, "ENOUGH", 16)
        taken = DecimatingBuffer(2, start, stop, average)
        for part in np.split(values, np.cumsum(sizes)[:-1] if sizes else []):
            taken.add(part)
    kept = values[start:stop]
    assert taken.rows == len(values)
    if average is None:
        assert taken.factor == next(f for f in 2 ** np.arange(20) if len(kept) // f <= 16)
    means = kept[: len(kept) // taken.factor * taken.factor].reshape(-1, taken.factor, 2).mean(axis=1)
    if len(means):
        np.testing.assert_allclose(np.stack((taken.column(0), taken.column(1)), axis=1), means, atol=1e-12)


@given(sizes=st.lists(st.integers(1, 10_000), min_size=1, max_size=12), enough=st.integers(100, 30_000))
def test_the_longest_phases_give_way_first(sizes, enough):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decimating_buffer, "ENOUGH", enough)
        averages = shared_averages(sizes, None)
    assert sum(n // a for n, a in zip(sizes, averages, strict=True)) <= enough
    most = max(n // a for n, a in zip(sizes, averages, strict=True))
    assert all(2 * (n // a + 1) > most for n, a in zip(sizes, averages, strict=True) if a > 1)


@pytest.mark.skipif(sys.platform != "linux", reason="the limit is one of Linux")
@pytest.mark.parametrize(
    "kind", ["csv", "bag", *(pytest.param(k, marks=pytest.mark.soak) for k in ("npz", "mat5", "mat73"))]
)
def test_memory_does_not_grow_with_the_file(kind, tmp_path):
    """Ten pieces in the room in which every sample of them does not fit."""
    (tmp_path / "short").mkdir()
    short = long_recordings.write(tmp_path / "short", kind, long_recordings.PIECE)
    path = long_recordings.write(tmp_path, kind, 10 * long_recordings.PIECE)
    size, period, mean = long_recordings.read_within(80_000_000, path, short, enough=1 << 18)
    assert size == 10 * long_recordings.PIECE // 8
    assert period == pytest.approx(8 * long_recordings.PERIOD)
    assert mean == pytest.approx(5.0, abs=1e-5)
    if kind in ("npz", "bag"):
        assert "more than the memory holds" in long_recordings.read_within(80_000_000, path, short, average=1)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["csv", "npz", "mat5", "mat73", "bag"])
def test_several_gigabytes_are_read_within_two(kind, tmp_path):
    rows = {"csv": 160_000_000, "mat5": 200_000_000, "npz": 260_000_000, "mat73": 260_000_000, "bag": 130_000_000}[kind]
    (tmp_path / "short").mkdir()
    short = long_recordings.write(tmp_path / "short", kind, long_recordings.PIECE)
    path = long_recordings.write(tmp_path, kind, rows)
    size, period, mean = long_recordings.read_within(2_000_000_000, path, short)
    assert (1 << 23) <= size <= (1 << 24)
    assert size * period == pytest.approx(rows * long_recordings.PERIOD, rel=1e-6)
    assert mean == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("enough", [300, 1 << 24])
def test_a_column_is_the_same_in_memory_and_on_disk(enough, monkeypatch):
    monkeypatch.setattr(column, "ENOUGH", enough)
    values = np.random.default_rng(2).normal(size=5_000)
    own = column.Column(np.float64)
    own.fill(0.5, 100)
    for part in np.split(values, [17, 400, 401, 3_000]):
        own.extend(part)
        assert own.array().size == len(own)
    np.testing.assert_array_equal(own.array(), np.concatenate((np.full(100, 0.5), values)))


def test_the_times_and_labels_of_a_table_are_averaged_with_it(tmp_path):
    labels = np.where(np.arange(600) < 300, "rest", "triangle")
    rows = "".join(f"{PERIOD * i:.4f},{VOLTAGE[i]},{MICRONS[i]},{labels[i]}\n" for i in range(600))
    (tmp_path / "t.csv").write_text("time_s,voltage_V,displacement_um,phase\n" + rows)
    rest, triangle = read(tmp_path / "t.csv", average=10)
    assert (rest.phase, rest.size, triangle.phase, triangle.size) == ("rest", 30, "triangle", 30)
    assert rest.sample_period == pytest.approx(10 * PERIOD)
    assert triangle.continues
