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

"""Further axes are named by their numbers, and every format reads the same axes from the same names."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import io

from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.model.axes_samples import columns, names
from piezo_hysteresis.recording import read

PERIOD = 1e-3
RANDOM = np.random.default_rng(1)
VOLTAGES = RANDOM.normal(size=(500, 3))
DISPLACEMENTS = RANDOM.normal(size=(500, 2))
PLAIN = ("time", "voltage", "voltage_2", "voltage_3", "displacement", "displacement_2")
WITH_UNITS = ("time_ms", "voltage_mV", "voltage_2_mV", "voltage_3_V", "displacement_um", "displacement_2_nm")
FACTORS = (1e3, 1e3, 1e3, 1.0, 1e6, 1e9)


def write_csv(path, arrays):
    np.savetxt(path, np.column_stack(list(arrays.values())), delimiter=",", header=",".join(arrays), comments="")


def write_npy(path, arrays):
    table = np.zeros(500, [(name, "f8") for name in arrays])
    for name, values in arrays.items():
        table[name] = values
    np.save(path, table)


def write_hdf5(path, arrays):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[f"run/{name}"] = values


def write_tdms(path, arrays):
    tdms = pytest.importorskip("nptdms")
    with tdms.TdmsWriter(path) as writer:
        writer.write_segment([tdms.ChannelObject("Untitled", name, values) for name, values in arrays.items()])


WRITERS = {
    "run.csv": write_csv,
    "run.npz": lambda path, arrays: np.savez(path, **arrays),
    "run.mat": io.savemat,
    "run.npy": write_npy,
    "run.h5": write_hdf5,
    "run.tdms": write_tdms,
}


def arrays(titles, factors=(1.0,) * 6):
    held = np.column_stack((PERIOD * np.arange(500), VOLTAGES, DISPLACEMENTS)) * factors
    return dict(zip(titles, held.T.copy(), strict=True))


@pytest.mark.parametrize("file", WRITERS)
@pytest.mark.parametrize(("titles", "factors"), [(PLAIN, (1.0,) * 6), (WITH_UNITS, FACTORS)])
def test_every_format_reads_the_axes_by_their_numbers(tmp_path, file, titles, factors):
    WRITERS[file](tmp_path / file, arrays(titles, factors))
    (record,) = read(tmp_path / file, phases="noise")
    assert names(record, "voltage") == ("voltage", "voltage_2", "voltage_3")
    assert names(record, "displacement") == ("displacement", "displacement_2")
    np.testing.assert_allclose(columns(record, "voltage"), VOLTAGES, rtol=1e-12)
    np.testing.assert_allclose(columns(record, "displacement"), DISPLACEMENTS, rtol=1e-12)
    assert record.sample_period == pytest.approx(PERIOD)


@pytest.mark.parametrize("file", WRITERS)
def test_a_column_that_is_named_for_the_first_axis_is_no_further_axis(tmp_path, file):
    WRITERS[file](tmp_path / file, arrays(PLAIN))
    places = {"voltage": "voltage_2", "displacement": "displacement_2"}
    if file == "run.csv":
        places = {"voltage": 3, "displacement": 6}
    (record,) = read(tmp_path / file, phases="noise", columns=places)
    assert set(record.channels) == {"voltage_3"}
    np.testing.assert_allclose(record.voltage, VOLTAGES[:, 1])
    np.testing.assert_allclose(record.displacement, DISPLACEMENTS[:, 1])


@pytest.mark.parametrize("file", ["run.npz", "run.mat"])
def test_an_axis_that_ends_early_is_not_left_out_in_silence(tmp_path, file):
    short = arrays(PLAIN)
    short["voltage_2"] = short["voltage_2"][:-1]
    WRITERS[file](tmp_path / file, short)
    with pytest.raises(PiezoError, match="voltage_2"):
        read(tmp_path / file)


def test_an_axis_that_is_left_out_makes_the_recording_doubtful(tmp_path):
    damaged = arrays(PLAIN)
    damaged["displacement_2"][7] = np.nan
    write_csv(tmp_path / "run.csv", damaged)
    assert any(n.severe and "displacement_2" in n.message for n in read(tmp_path / "run.csv").notices)


def test_titles_with_spaces_are_axes_too(tmp_path):
    write_csv(
        tmp_path / "t.csv", arrays(("Time [s]", "Voltage", "Voltage 2", "Voltage 3", "Weg [m]", "Displacement 2"))
    )
    (record,) = read(tmp_path / "t.csv", phases="noise")
    assert names(record, "voltage") == ("voltage", "voltage_2", "voltage_3")
    assert names(record, "displacement") == ("displacement", "displacement_2")
