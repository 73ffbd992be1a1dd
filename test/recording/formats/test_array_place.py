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

"""How a user names an array in a file, and what a message says where the names are not clear."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import read
from piezo_hysteresis.recording.wanted_path import read_path

T = 1e-3 * np.arange(2000)
U = 5.0 - 5.0 * np.cos(2 * np.pi * 2.0 * T)
Y = 1e-6 * U


@pytest.fixture
def matrix(tmp_path):
    """An HDF5 file with one matrix of time, voltage and displacement."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "m.h5", "w") as file:
        file["run/data"] = np.column_stack((T, U, Y))
    return tmp_path / "m.h5"


@pytest.fixture
def labview(tmp_path):
    """A TDMS file of a card, whose two groups have a channel of the same name."""
    tdms = pytest.importorskip("nptdms")
    waveform = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
    channels = (("out", "Dev1/ao0", U, "V"), ("in", "Dev1/ai3", 1e6 * Y, "um"), ("in", "Dev1/ao0", U, "V"))
    with tdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(
            [tdms.ChannelObject(group, name, data, waveform | {"unit_string": u}) for group, name, data, u in channels]
        )
    return tmp_path / "run.tdms"


def test_a_matrix_is_listed_with_its_shape_and_the_name_of_a_column(matrix):
    with pytest.raises(RecordingError, match=r"run.data of shape \(2000, 3\), .* e.g. 'voltage=run.data\[1\]'"):
        read(matrix)


@pytest.mark.parametrize("places", [(1, 2, 3), ("data[1]", "data[2]", "data[3]"), ("run.data[1]", "2", "data[3]")])
def test_a_column_of_the_only_matrix_needs_no_more_than_its_number(matrix, places):
    (record,) = read(matrix, columns=dict(zip(("time", "voltage", "displacement"), places, strict=True)), phases="x")
    np.testing.assert_array_equal(record.voltage, U)
    np.testing.assert_array_equal(record.displacement, Y)


def test_a_column_that_a_matrix_does_not_have_is_named(matrix):
    with pytest.raises(RecordingError, match=r"run.data: got shape \(2000, 3\), expected a matrix with a column 7"):
        read(matrix, columns={"voltage": 7, "displacement": 3}, sample_period=1e-3)


def test_a_channel_needs_no_group_and_no_unit_if_it_is_the_only_one(labview):
    (record,) = read(labview, columns={"voltage": "out.Dev1/ao0", "displacement": "Dev1/ai3"}, phases="x")
    np.testing.assert_allclose(record.displacement, Y)


@pytest.mark.parametrize("place", ["Dev1/ao0", "1"])
def test_a_name_that_is_not_clear_is_answered_with_the_whole_names(labview, place):
    with pytest.raises(RecordingError, match=rf"`columns`: got '{place}' for voltage, .*out.Dev1/ao0 \(V\)"):
        read(labview, columns={"voltage": place, "displacement": "Dev1/ai3"})


@pytest.mark.parametrize("name", ["sample_period", "dt", "Fs"])
def test_an_attribute_of_the_file_may_hold_the_sample_period(tmp_path, name):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["voltage"], file["displacement"] = U, Y
        file.attrs[name] = 1e3 if name == "Fs" else 1e-3
    found = read(tmp_path / "a.h5")
    assert found[0].sample_period == pytest.approx(1e-3)
    assert any(n.kind == "columns" and f"attributes.{name}" in n.message for n in found.notices)


@pytest.mark.parametrize("value", [-1e-3, 0.0, np.inf, "1 ms", [1e-3, 2e-3]])
def test_an_attribute_that_is_no_period_is_not_used_and_the_accepted_names_are_listed(tmp_path, value):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["voltage"], file["displacement"] = U, Y
        file.attrs["sample_period"] = value
    with pytest.raises(RecordingError, match="called sample_period, dt, ts or fs; give `sample_period`"):
        read(tmp_path / "a.h5")


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
def test_a_text_under_the_name_of_an_array_is_called_that(tmp_path, name):
    (tmp_path / name).write_text("hello")
    for reader in (read, read_path) if name == "a.npz" else (read,):
        with pytest.raises(RecordingError) as refused:
            reader(tmp_path / name)
        assert name in str(refused.value)
        assert "pickle" not in str(refused.value) and "unsafely" not in str(refused.value)


@pytest.mark.parametrize("method", [8, 19])
def test_a_damaged_path_is_refused_in_one_line(tmp_path, method):
    np.savez(tmp_path / "a.npz", displacement=np.zeros(5))
    content = bytearray((tmp_path / "a.npz").read_bytes())
    content[content.index(b"PK\x01\x02") + 10] = method  # compression in the directory of the archive
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(RecordingError, match=r"a\.npz: no NPZ file that can be read \(.*\), expected numbers"):
        read_path(tmp_path / "a.npz")
