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

"""Names, times and choices that files of other software have, and messages that say what is wrong with them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import io

from piezo_hysteresis import recording
from piezo_hysteresis.errors import PiezoError, RecordingError

PERIOD = 1e-3
T = PERIOD * np.arange(2000)
U = 5.0 - 5.0 * np.cos(2 * np.pi * 2.0 * T)
Y = 1e-6 * U


@pytest.fixture(params=["npz", "mat"])
def save(request, tmp_path):
    """Write arrays by name into a file of one format."""

    def write(**arrays):
        path = tmp_path / f"run.{request.param}"
        if request.param == "npz":
            np.savez(path, **arrays)
        else:
            io.savemat(path, arrays)
        return path

    return write


def test_a_vector_of_times_called_ts_is_no_sample_period(save):
    found = recording.read(save(u=U, y=Y, ts=T), columns={"time": "ts"})
    assert found[0].sample_period == pytest.approx(PERIOD)
    assert found.size == T.size


def test_a_column_of_times_is_found_by_its_name_and_unit(save):
    found = recording.read(save(drive_V=U, sensor_um=1e6 * Y, t_ms=1e3 * T))
    assert found[0].sample_period == pytest.approx(PERIOD)
    assert found.range == pytest.approx(np.ptp(Y))


def test_a_sample_rate_of_zero_is_named(save):
    with pytest.raises(RecordingError, match="fs: got a sample rate of 0 Hz, expected more than 0"):
        recording.read(save(voltage=U, displacement=Y, fs=0.0))


def test_one_array_is_not_voltage_and_displacement(save):
    path = save(u=U, y=Y, dt=PERIOD)
    with pytest.raises(RecordingError, match="same column for voltage and displacement"):
        recording.read(path, columns={"voltage": "y", "displacement": "y"})


def test_more_samples_in_one_than_there_are(save):
    path = save(voltage=U, displacement=Y, dt=PERIOD)
    with pytest.raises(RecordingError, match="`average`: got 5000, expected at most 2000 samples"):
        recording.read(path, average=5000)


def test_a_key_that_is_missing_is_named(tmp_path):
    np.savez(tmp_path / "run.npz", voltage=U, displacement=Y, t=T)
    with pytest.raises(RecordingError, match="expected the key 'zeit'"):
        recording.read(tmp_path / "run.npz", columns={"time": "zeit"})


def test_a_phase_that_averaging_leaves_out_is_said(tmp_path):
    for number, size in ((1, 2000), (2, 50)):
        np.savez(tmp_path / f"0{number}_sine.npz", voltage=U[:size], displacement=Y[:size], sample_period=PERIOD)
    found = recording.read(tmp_path, average=100)
    assert len(found) == 1
    assert any(n.kind == "left_out" and n.message.startswith("02_sine.npz has 50 samples") for n in found.notices)


def test_a_text_table_has_the_same_limits(tmp_path):
    np.savetxt(
        tmp_path / "run.csv", np.c_[T, U, Y], delimiter=",", header="time_s,voltage_V,displacement_m", comments=""
    )
    for options, said in (
        ({"average": 5000}, "`average`: got 5000, expected at most 2000 samples"),
        ({"average": 2000}, "time: got the time of one sample"),
        ({"rows": (5, 5)}, "`rows`: got 5:5, expected a part that is not empty"),
        ({"columns": {"voltage": 3}}, "same column for voltage and displacement"),
    ):
        with pytest.raises(PiezoError, match=said):
            recording.read(tmp_path / "run.csv", **options)


def test_names_with_dots_in_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["ai.0"], file["group/ai.1"], file["fs"] = U, 1e6 * Y, 1.0 / PERIOD
    places = {"voltage": "ai.0", "displacement": "group.ai.1"}
    found = recording.read(tmp_path / "run.h5", columns=places, units={"displacement": "um"})
    assert found.range == pytest.approx(np.ptp(Y))


def test_dates_as_times_in_tdms(tmp_path):
    tdms = pytest.importorskip("nptdms")
    dates = np.datetime64("2026-01-01T10:00:00", "us") + (1e6 * T).astype("timedelta64[us]")
    channels = [tdms.ChannelObject("run", name, data) for name, data in (("time", dates), ("u", U), ("y", Y))]
    with tdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(channels)
    found = recording.read(tmp_path / "run.tdms")
    assert found[0].sample_period == pytest.approx(PERIOD) and found.size == T.size


@pytest.mark.parametrize(("factor", "power"), [(1e6, "1e-6"), (1e9, "1e-9"), (1e-6, "1e+6")])
@pytest.mark.parametrize("stroke", [2e-6, 15e-6, 100e-6, 500e-6])
def test_the_factor_of_a_wrong_unit_of_length(tmp_path, stroke, factor, power):
    y = stroke * U / 10.0 * factor
    np.savez(tmp_path / "run.npz", voltage=U, displacement=y, sample_period=PERIOD)
    (message,) = (n.message for n in recording.read(tmp_path / "run.npz").notices if n.kind == "units")
    assert f"a unit may be off by {power}" in message
