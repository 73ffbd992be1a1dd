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

"""Files of other software that hold arrays under names: dSPACE, NumPy, LabVIEW, HDF5, as a user imports them."""

import h5py
import numpy as np
import pytest
from scipy import io

from piezo_hysteresis.errors import PiezoError, RecordingError
from piezo_hysteresis.recording import read

from ..piezo_command import piezo

TIME = np.arange(400) * 5e-3
VOLTAGE = 1.8 - 1.8 * np.cos(2 * np.pi * TIME)
MICRONS = 12.0 * VOLTAGE


def assert_is_the_recording(record):
    np.testing.assert_allclose(record.voltage, VOLTAGE, rtol=1e-12)
    np.testing.assert_allclose(record.displacement, 1e-6 * MICRONS, rtol=1e-12)
    assert record.sample_period == pytest.approx(5e-3, rel=1e-12)


def signals(*triples):
    """Struct array of a capture: name, unit, data."""
    kind = [("Name", object), ("Type", object), ("Data", object), ("Unit", object)]
    array = np.zeros((1, len(triples)), kind)
    for at, (name, unit, data) in enumerate(triples):
        array[0, at] = (name, "ML_DOUBLE", np.atleast_2d(data), unit)
    return array


@pytest.fixture
def dspace(tmp_path):
    """X and Y as ControlDesk writes them: structs with Name and Data, signals named by their path in the model."""
    capture = {
        "X": signals(("", "s", TIME)),
        "Y": signals(
            ('"Model Root"/"Drive"/"Out1"', "V", VOLTAGE),
            ('"Model Root"/"Sensor/um"', "um", MICRONS),
            ('"Model Root"/"Other"/"Out1"', "V", 0 * VOLTAGE),
        ),
        "Description": "free text",
    }
    io.savemat(tmp_path / "capture.mat", {"run_001": capture})
    return tmp_path / "capture.mat"


def test_a_capture_of_dspace_is_mapped_by_the_names_of_its_signals(dspace, tmp_path):
    words = ["--column", "voltage=run_001.Y.Out1 (V)", "--column", "displacement=run_001.Y.um (um)", "--phase", "x"]
    done = piezo("import", dspace, "-o", tmp_path / "out", *words)
    assert done.returncode == 0, done.stderr
    assert_is_the_recording(read(tmp_path / "out")[0])


def test_a_capture_without_a_mapping_is_refused_with_the_names_that_were_seen(dspace, tmp_path):
    done = piezo("import", dspace, "-o", tmp_path / "out")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "run_001.X.time (s), run_001.Y.Out1 (V), run_001.Y.um (um), run_001.Y.Out1 2 (V)" in line
    assert "name it by --column" in line


def test_a_capture_with_plain_names_needs_no_mapping(tmp_path):
    capture = {
        "X": signals(("time", "s", TIME)),
        "Y": signals(("drive", "V", VOLTAGE), ("position", "um", MICRONS)),
    }
    io.savemat(tmp_path / "capture.mat", {"exp": capture})
    (record,) = experiment = read(tmp_path / "capture.mat", phases="x")
    assert_is_the_recording(record)
    assert any("exp.Y.position (um)" in n.message for n in experiment.notices)


def test_a_variable_may_state_its_unit_after_the_name_of_its_channel(tmp_path):
    io.savemat(tmp_path / "m.mat", {"time_ms": 1e3 * TIME, "voltage_mV": 1e3 * VOLTAGE, "displacement_um": MICRONS})
    (record,) = read(tmp_path / "m.mat", phases="x")
    assert_is_the_recording(record)


def test_one_signal_is_a_struct_and_no_array(tmp_path):
    capture = {"X": signals(("t", "s", TIME)), "Y": signals(("u", "V", VOLTAGE)), "Z": signals(("y", "um", MICRONS))}
    io.savemat(tmp_path / "capture.mat", {"exp": capture})
    (record,) = read(tmp_path / "capture.mat", phases="x")
    assert_is_the_recording(record)


@pytest.mark.parametrize("turned", [False, True])
def test_columns_of_a_numpy_array_are_numbered_from_one(tmp_path, turned):
    array = np.column_stack((TIME, MICRONS, VOLTAGE))
    np.save(tmp_path / "a.npy", array.T if turned else array)
    words = ["--column", "time=1", "--column", "displacement=2", "--column", "voltage=3"]
    done = piezo(
        "import", tmp_path / "a.npy", "-o", tmp_path / "o", *words, "--unit", "displacement=um", "--phase", "x"
    )
    assert done.returncode == 0, done.stderr
    assert_is_the_recording(read(tmp_path / "o")[0])
    done = piezo("import", tmp_path / "a.npy", "-o", tmp_path / "none")
    assert done.returncode == 2
    assert "got the columns 1, 2, 3, expected voltage; name it by --column" in done.stderr


def test_fields_of_a_structured_array_have_names(tmp_path):
    array = np.zeros(400, [("time_s", "f8"), ("voltage_V", "f4"), ("position_um", "f8"), ("note", "U4")])
    array["time_s"], array["voltage_V"], array["position_um"] = TIME, VOLTAGE, MICRONS
    np.save(tmp_path / "a.npy", array)
    (record,) = read(tmp_path / "a.npy", phases="x")
    np.testing.assert_allclose(record.displacement, 1e-6 * MICRONS, rtol=1e-12)
    np.testing.assert_allclose(record.voltage, VOLTAGE, atol=1e-6)
    with pytest.raises(RecordingError, match="got <U4, expected real numbers"):
        read(tmp_path / "a.npy", columns={"displacement": "note"})


@pytest.mark.parametrize("data", [np.arange(5.0), np.zeros((3, 3, 3)), np.array([{}], dtype=object)])
def test_arrays_without_columns_are_refused(tmp_path, data):
    np.save(tmp_path / "a.npy", data, allow_pickle=True)
    with pytest.raises(PiezoError, match=r"a\.npy"):
        read(tmp_path / "a.npy")


def test_plain_hdf5_has_its_columns_last(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/data"] = np.column_stack((VOLTAGE, MICRONS))
        file["run/fs"] = 200.0
    (record,) = read(
        tmp_path / "a.h5",
        columns={"voltage": "run.data[1]", "displacement": "run.data[2]"},
        units={"displacement": "um"},
        phases="x",
    )
    assert_is_the_recording(record)
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        file["run/time_s"], file["run/drive_V"], file["run/sensor_um"] = TIME, VOLTAGE, MICRONS
    assert_is_the_recording(read(tmp_path / "b.hdf5", phases="x")[0])


@pytest.fixture
def labview(tmp_path):
    """A TDMS file as LabVIEW writes waveforms, here written by npTDMS."""
    nptdms = pytest.importorskip("nptdms")
    waveform = {"wf_increment": 5e-3, "wf_samples": 400, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        for part in (slice(0, 150), slice(150, 400)):
            writer.write_segment(
                [
                    nptdms.ChannelObject("Scan 1", "Drive", VOLTAGE[part], waveform | {"unit_string": "V"}),
                    nptdms.ChannelObject("Scan 1", "Sensor [x]", MICRONS[part], waveform | {"unit_string": "um"}),
                ]
            )
    return tmp_path / "run.tdms"


def test_waveforms_of_labview_give_their_units_and_their_period(labview, tmp_path):
    done = piezo("import", labview, "-o", tmp_path / "out", "--phase", "x")
    assert done.returncode == 0, done.stderr
    assert "Scan 1.Sensor (x) (um)" in done.stdout
    assert_is_the_recording(read(tmp_path / "out")[0])
    (record,) = read(labview, rows=(100, 300), phases="x")
    np.testing.assert_allclose(record.voltage, VOLTAGE[100:300], rtol=1e-12)


def read_or_refuse(path):
    """Read a file, or refuse it in one line that names it."""
    try:
        read(path)
    except PiezoError as error:
        line = str(error)
    else:
        return
    assert path.name in line
    assert "\n" not in line


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.99])
def test_a_tdms_file_that_ends_early_is_read_or_refused(labview, share):
    data = labview.read_bytes()
    labview.write_bytes(data[: int(share * len(data))])
    read_or_refuse(labview)


@pytest.mark.parametrize("seed", range(40))
def test_changed_bytes_of_a_tdms_file_are_refused_or_read(labview, seed):
    random = np.random.default_rng(seed)
    data = bytearray(labview.read_bytes())
    for at in random.integers(0, 600, 1 + seed % 8):
        data[at] = (0, 255, int(random.integers(256)))[seed % 3]
    labview.write_bytes(data)
    read_or_refuse(labview)


def test_an_unknown_file_ending_is_refused(tmp_path):
    (tmp_path / "a.xlsx").write_bytes(b"PK\3\4\0\0\0\0")
    done = piezo("import", tmp_path / "a.xlsx", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "got a file ending '.xlsx'" in done.stderr
    assert "choose one by --format, or export the data as text" in done.stderr


@pytest.mark.parametrize("key", ["units", "Unit"])
@pytest.mark.parametrize("form", [str, np.bytes_, lambda text: np.array([text], dtype=object)])
def test_the_unit_beside_an_hdf5_array_counts_as_that_in_a_title(tmp_path, key, form):
    time = 1e-3 * np.arange(2000)
    drive = 5.0 + np.sin(2.0 * np.pi * 5.0 * time)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("run")
        group["note"] = "a text that is not a signal"
        group["time"] = time
        for name, values, unit in (("drive", drive, "V"), ("stage", 3.0 * drive, "um")):
            group[name] = values
            group[name].attrs[key] = form(unit)
    (record,) = read(tmp_path / "a.h5")
    np.testing.assert_allclose(record.displacement, 3e-6 * drive)
    (named,) = read(tmp_path / "a.h5", columns={"voltage": "run.drive", "displacement": "run.stage"})
    np.testing.assert_array_equal(named.displacement, record.displacement)
