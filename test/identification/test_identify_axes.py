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

"""The matrix, the loops and the file of several axes, on the plant of `coupled_plant`."""

import numpy as np
import pytest

from piezo_hysteresis.cli.main import main
from piezo_hysteresis.errors import IdentificationError, ModelError
from piezo_hysteresis.identification.identify_axes import axes_errors, identify_axes
from piezo_hysteresis.model import axes_file
from piezo_hysteresis.model.axes_samples import columns
from piezo_hysteresis.record import Record

from ..coupled_plant import GAINS, plant


@pytest.fixture(scope="module")
def model():
    return identify_axes([plant(1), plant(2)], length=20)


def test_the_planted_matrix_is_recovered():
    found = identify_axes([plant(1, share=0.0)], length=20, passes=1)
    assert np.allclose(np.linalg.inv(found.elongation), GAINS, atol=2e-3 * abs(GAINS).max())
    assert max(e.percent for e in axes_errors(found, [plant(3, share=0.0)])) < 0.01


def test_the_planted_loops_are_predicted_on_a_record_that_was_not_fitted(model):
    linear = identify_axes([plant(1), plant(2)], length=20, passes=1)
    left, left_linear = (sum(e.rms for e in axes_errors(m, [plant(3)])) for m in (model, linear))
    assert left < 0.35 * left_linear


def test_every_cutting_gives_the_same_bits(model):
    u = columns(plant(3), "voltage")[:700]
    whole, _ = model.run(u, model.rest())
    state, parts = model.rest(), []
    for block in np.split(u, [1, 2, 5, 30, 333]):
        y, state = model.run(block, state)
        parts.append(y)
    assert np.array_equal(whole, np.concatenate(parts))


def test_a_file_reads_back_bit_for_bit(model, tmp_path):
    again = axes_file.load(axes_file.save(model, tmp_path / "m.npz"))
    u = columns(plant(3), "voltage")
    assert np.array_equal(again.run(u, again.rest())[0], model.run(u, model.rest())[0])


def test_two_drives_move_three_displacements():
    records = [plant(1), plant(2)]
    two = [
        Record(r.voltage, r.displacement, 1e-3, channels={n: v for n, v in r.channels.items() if n != "voltage_3"})
        for r in records
    ]
    assert identify_axes(two, length=10).run(np.zeros((5, 2)), identify_axes(two, length=10).rest())[0].shape == (5, 3)


@pytest.mark.parametrize(
    "gains", [[[1.0, 1.0]], [[1.0, 0.07]], [[2.0, 1.0, -1.0], [0.3, -2.0, 1.0]], [[1.0], [-0.4]]], ids=str
)
def test_numbers_of_drives_and_displacements_may_differ(gains):
    gains = 1e-6 * np.array(gains)
    records = [plant(seed, gains=gains) for seed in (1, 2)]
    left = {
        passes: sum(e.rms for e in axes_errors(identify_axes(records, 20, passes=passes), [plant(3, gains=gains)]))
        for passes in (1, 3)
    }
    assert left[3] < left[1]


def test_drives_that_depend_on_one_another_are_refused():
    records = [plant(seed, gains=np.array([[1e-6, 1e-6]])) for seed in (1, 2)]
    same = [Record(r.voltage, r.displacement, 1e-3, channels={"voltage_2": 0 * r.voltage}) for r in records]
    with pytest.raises(IdentificationError, match="constant or depend on one another"):
        identify_axes(same, length=10)


def test_invalid_records_and_files_are_refused(model, tmp_path):
    with pytest.raises(IdentificationError, match="record longer"):
        identify_axes([plant(1, size=100)])
    with pytest.raises(ModelError, match="shape"):
        model.run(np.zeros((5, 2)), model.rest())
    with pytest.raises(ModelError, match=r"ends in \.npz"):
        axes_file.save(model, tmp_path / "m.yaml")
    (tmp_path / "broken.npz").write_bytes(b"PK")
    with pytest.raises(ModelError, match="several axes"):
        axes_file.load(tmp_path / "broken.npz")


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"taps": np.array(["a", "b"])}, "could not convert"),
        ({"taps": np.zeros((3, 3, 0, 18))}, "at least one tap"),
        ({"radii": [-1.0, 0.2, 0.8]}, "no negative width"),
        ({"memory": 1e9}, "memory: got"),
        ({"sample_period": 0.0}, "sample_period: got 0.0"),
        ({"free_run_error": [1e-9]}, r"free_run_error: got shape \(1,\)"),
        ({"level_max": np.nan}, "level_max: got nan"),
    ],
)
def test_a_file_with_impossible_numbers_is_refused(model, tmp_path, changed, reason):
    held = dict(np.load(axes_file.save(model, tmp_path / "model.npz")))
    np.savez(tmp_path / "model.npz", **held | changed)
    with pytest.raises(ModelError, match=reason):
        axes_file.load(tmp_path / "model.npz")


def test_a_file_with_a_damaged_header_is_refused(model, tmp_path):
    path = axes_file.save(model, tmp_path / "model.npz")
    path.write_bytes(path.read_bytes().replace(b"(3, 3, 20, 18)", b"(3, 3, 20, 18 "))
    with pytest.raises(ModelError, match=r"model\.npz: damaged"):
        axes_file.load(path)


def test_a_file_of_an_earlier_version_has_no_level_and_no_error(model, tmp_path):
    held = dict(np.load(axes_file.save(model, tmp_path / "model.npz")))
    del held["level_max"], held["free_run_error"]
    np.savez(tmp_path / "model.npz", **held)
    again = axes_file.load(tmp_path / "model.npz")
    assert again.level_max == np.inf
    assert again.free_run_error.size == 0
    assert axes_file.content_hash(again) == axes_file.content_hash(model)


def test_the_largest_level_is_that_of_the_records(model):
    u = columns(plant(1), "voltage")
    assert 0.2 < model.level_max < 1.5 * float(np.sqrt(np.mean(u**2)))


def test_the_command_identifies_and_validates_a_recording(tmp_path, capsys):
    for seed in (1, 2):
        r = plant(seed)
        np.savez(
            tmp_path / f"0{seed}_noise.npz",
            voltage=r.voltage,
            displacement=r.displacement,
            sample_period=1e-3,
            **r.channels,
        )
    files = [str(tmp_path / f"0{seed}_noise.npz") for seed in (1, 2)]
    assert main(["identify", *files, "--taps", "20", "-o", str(tmp_path / "m.npz")]) == 0
    errors = axes_errors(axes_file.load(tmp_path / "m.npz"), [plant(1), plant(2)])
    mean = [np.sqrt(np.mean([e.rms**2 for e in errors[axis::3]])) for axis in range(3)]
    assert axes_file.load(tmp_path / "m.npz").free_run_error == pytest.approx(mean)
    assert main(["validate", str(tmp_path / "m.npz"), *files]) == 0
    assert "displacement_3" in capsys.readouterr().out
