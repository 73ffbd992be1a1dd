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

"""NPZ folders: exact round trips, holes reported, no pickle, no allocation beyond the file."""

import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis.errors import PiezoError, RecordError, RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write


def keys(**changes):
    return {"voltage": np.arange(4.0), "displacement": np.arange(4.0) * 1e-6, "sample_period": 1e-3} | changes


def test_a_file_with_the_three_keys_is_a_phase_named_by_its_file(tmp_path):
    np.savez(tmp_path / "03_sine_50hz.npz", **keys())
    (record,) = read(tmp_path)
    assert (record.phase, record.size, record.sample_period) == ("sine_50hz", 4, 1e-3)
    assert (record.start_time, record.continues, record.initial_voltage) == (0.0, False, None)


def test_files_are_ordered_by_number_and_follow_each_other_in_time(tmp_path):
    for number, phase in ((10, "hold"), (2, "step"), (1, "rest")):
        np.savez(tmp_path / f"{number}_{phase}.npz", **keys())
    experiment = read(tmp_path)
    assert [r.phase for r in experiment] == ["rest", "step", "hold"]
    assert [r.start_time for r in experiment] == [0.0, 4e-3, 8e-3]


@pytest.mark.parametrize("phase", [np.array("triangle"), np.array(["triangle"]), np.array(b"triangle")])
def test_phase_may_be_any_numpy_text(tmp_path, phase):
    np.savez(tmp_path / "01_x.npz", **keys(phase=phase))
    assert read(tmp_path)[0].phase == "triangle"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"sample_period": None}, "sample_period"),
        ({"voltage": None}, "voltage"),
        ({"sample_period": 0.0}, "period of 0 s"),
        ({"sample_period": [1.0, 2.0]}, "one number"),
        ({"displacement": np.arange(3.0)}, "3 samples"),
        ({"voltage": np.ones((2, 2)), "displacement": np.ones((2, 2))}, "one dimension"),
        ({"voltage": np.array(["a"])}, "real numbers"),
        ({"voltage": np.full(4, np.nan)}, "no finite"),
        ({"phase": 3.0}, "one text"),
    ],
)
def test_an_invalid_phase_gives_one_line_with_the_file_name(tmp_path, changes, says):
    np.savez(tmp_path / "01_bad.npz", **{k: v for k, v in keys(**changes).items() if v is not None})
    with pytest.raises((RecordingError, RecordError), match=says) as error:
        read(tmp_path)
    assert "01_bad.npz" in str(error.value) and "\n" not in str(error.value)


def test_non_finite_samples_split_the_phase_and_are_reported(tmp_path):
    displacement = np.arange(100.0) * 1e-6
    displacement[[40, 41]] = np.nan, np.inf
    np.savez(tmp_path / "01_x.npz", **keys(voltage=np.arange(100.0), displacement=displacement))
    experiment = read(tmp_path)
    assert [(r.size, r.continues, r.truncated) for r in experiment] == [(40, False, False), (58, True, True)]
    assert experiment[1].start_time == pytest.approx(42e-3)
    assert "non_finite" in {n.kind for n in experiment.notices}


class Bomb:
    """Creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (Path(self.path),))


@pytest.mark.parametrize("key", ["voltage", "displacement", "phase", "sample_period"])
def test_pickled_objects_are_refused_unopened(tmp_path, key):
    marker = tmp_path / "executed"
    bomb = np.array([Bomb(str(marker))], dtype=object)
    np.savez(tmp_path / "01_bad.npz", **keys(**{key: bomb}))
    with pytest.raises(RecordingError, match="pickled"):
        read(tmp_path)
    (tmp_path / "01_bad.npz").write_bytes(pickle.dumps(Bomb(str(marker))))
    with pytest.raises(PiezoError):
        read(tmp_path)
    assert not marker.exists()


def test_an_array_declared_larger_than_the_file_is_refused(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)})
    with zipfile.ZipFile(tmp_path / "01_bad.npz", "w") as archive:
        archive.writestr("voltage.npy", header.getvalue())
        archive.writestr("sample_period.npy", header.getvalue())
    with pytest.raises(RecordingError, match="more than the file"):
        read(tmp_path)


def test_a_second_experiment_is_not_mixed_into_a_folder(tmp_path):
    experiment = Experiment((Record([0.0, 1.0], [0.0, 1e-6], 1e-3),))
    write(experiment, tmp_path / "e")
    with pytest.raises(RecordingError, match="already"):
        write(experiment, tmp_path / "e")


def test_keys_units_and_period_of_a_foreign_archive_can_be_named(tmp_path):
    np.savez(tmp_path / "scan.npz", u=np.arange(4.0), y=np.arange(4.0))
    (record,) = read(
        tmp_path / "scan.npz",
        columns={"voltage": "u", "displacement": "y"},
        units={"displacement": "nm"},
        sample_period=2e-5,
        initial_voltage=-1.0,
        phases="triangle",
    )
    assert record.phase == "triangle" and record.sample_period == 2e-5 and record.initial_voltage == -1.0
    np.testing.assert_array_equal(record.displacement, np.arange(4.0) * 1e-9)


@pytest.mark.parametrize(("option", "key"), [(1e300, None), (None, 1e300), (None, -5000.0)])
def test_an_initial_voltage_that_no_stage_has_is_refused(tmp_path, option, key):
    np.savez(tmp_path / "01_sine.npz", **keys(**({} if key is None else {"initial_voltage": key})))
    with pytest.raises(RecordingError, match=r"initial voltage .* expected -1200 to 1200 V"):
        read(tmp_path, initial_voltage=option)


def test_a_first_phase_that_continues_another_is_truncated(tmp_path):
    np.savez(tmp_path / "07_triangle.npz", **keys(continues=True))
    assert (read(tmp_path)[0].continues, read(tmp_path)[0].truncated) == (False, True)


def test_an_archive_without_a_name_is_split_by_its_drive(tmp_path):
    drive = np.concatenate((np.zeros(1000), 1 - np.cos(np.arange(3000) * 2 * np.pi / 100)))
    np.savez(tmp_path / "scan.npz", **keys(voltage=drive, displacement=drive * 1e-6))
    assert [r.phase for r in read(tmp_path / "scan.npz")] == ["rest", "sine_10hz"]
    np.savez(tmp_path / "more.npz", **keys())
    with pytest.raises(RecordingError, match="2 files"):
        read(tmp_path, phases=[(0.0, "a"), (1.0, "b")])


def test_a_part_that_leaves_out_the_beginning_is_truncated(tmp_path):
    np.savez(tmp_path / "01_x.npz", **keys())
    assert read(tmp_path, rows=(1, None))[0].truncated
    assert not read(tmp_path, rows=(0, 3))[0].truncated
    assert not read(tmp_path, rows=(1, None), initial_voltage=0.0)[0].truncated
