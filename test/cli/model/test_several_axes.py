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

"""The commands for several axes: the verdict, the status where data are damaged, and what handles one axis only."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model

PERIOD = 1e-3


def write(path, clipped=False):
    """Two axes without memory, of which one may have a clipped sensor."""
    t = PERIOD * np.arange(4000)
    u, other = (5.0 - 5.0 * np.cos(2.0 * np.pi * f * t) for f in (1.0, 1.3))
    y = 1e-6 * u + 1e-8 * other
    y = np.minimum(y, 8e-6) if clipped else y
    np.savez(path, voltage=u, voltage_2=other, displacement=y, displacement_2=2e-6 * other, sample_period=PERIOD)
    return path


def test_a_model_of_several_axes_has_a_verdict(piezo, tmp_path):
    whole = write(tmp_path / "whole.npz")
    done = piezo("identify", whole, "-o", tmp_path / "model.npz", "--taps", 20)
    assert done.status == 0, done.err
    assert "The model describes this stage" in done.out.splitlines()[-1]
    assert piezo("validate", tmp_path / "model.npz", whole).status == 0


def test_a_rest_before_the_motion_is_not_judged_by_its_noise(piezo, tmp_path):
    """It was called poor, because its noise is as large as the range of the rest; 0.05 % of that of the stage."""
    held = dict(np.load(write(tmp_path / "moving.npz")))
    period, still = held.pop("sample_period"), np.zeros(1000)
    moving = {name: np.concatenate((still, values)) for name, values in held.items()}
    moving["displacement"] = moving["displacement"] + 5e-9 * np.random.default_rng(3).normal(size=5000)
    np.savez(tmp_path / "whole.npz", sample_period=period, **moving)
    done = piezo("identify", tmp_path / "whole.npz", "-o", tmp_path / "model.npz", "--taps", 20)
    assert done.status == 0 and any(line.startswith("rest") for line in done.out.splitlines()), done.out
    assert piezo("validate", tmp_path / "model.npz", tmp_path / "whole.npz").status == 0


def test_a_clipped_sensor_makes_it_doubtful(piezo, tmp_path):
    piezo("identify", write(tmp_path / "whole.npz"), "-o", tmp_path / "model.npz", "--taps", 20)
    clipped = write(tmp_path / "clipped.npz", clipped=True)
    for words in (("validate", tmp_path / "model.npz", clipped), ("identify", clipped, "-o", tmp_path / "new.npz")):
        done = piezo(*words)
        assert done.status == 1, done.err
        assert "doubtful" in done.out.splitlines()[-1]


@pytest.fixture
def coupled(tmp_path):
    """A record of two drives."""
    return write(tmp_path / "coupled.npz")


@pytest.fixture
def one_drive(tmp_path):
    """A record of one drive, which moves two displacements."""
    u = np.random.default_rng(3).normal(size=3000)
    np.savez(tmp_path / "a.npz", voltage=u, displacement=1e-6 * u, displacement_2=-4e-7 * u, sample_period=PERIOD)
    return tmp_path / "a.npz"


@pytest.fixture
def of_one_axis(tmp_path):
    """A model file of one axis."""
    model = Model((BoucWen(), Arx(a=[-0.5], b=[0.5], delay=1)), PERIOD, 10.0, 1e-5)
    return model_file.save(model, tmp_path / "one.yaml")


def refusal(done, status=2):
    """The last line on standard error."""
    assert done.status == status, done.out + done.err
    return done.err.splitlines()[-1]


def test_a_table_and_an_archive_with_the_same_names_are_the_same_axes(piezo, coupled, tmp_path):
    held = dict(np.load(coupled))
    period = held.pop("sample_period")
    held = {"time": period * np.arange(4000), **held}
    table = np.column_stack(list(held.values()))
    np.savetxt(tmp_path / "t.csv", table, delimiter=",", header=",".join(held), comments="")
    said = [
        piezo("identify", path, "-o", tmp_path / f"{path.suffix[1:]}.npz", "--taps", 20)
        for path in (coupled, tmp_path / "t.csv")
    ]
    assert [done.status for done in said] == [0, 0]
    archive, text = (dict(np.load(tmp_path / f"{name}.npz")) for name in ("npz", "csv"))
    assert all(np.array_equal(archive[name], text[name]) for name in archive)


def test_several_displacements_of_one_drive_are_several_axes(piezo, one_drive, tmp_path):
    done = piezo("identify", one_drive, "-o", tmp_path / "m.npz", "--taps", 20)
    assert done.status == 0, done.err
    assert "displacement_2" in done.out
    assert piezo("validate", tmp_path / "m.npz", one_drive).status == 0


def test_a_model_of_one_axis_says_which_displacements_it_leaves_out(piezo, one_drive, of_one_axis):
    done = piezo("validate", of_one_axis, one_drive)
    assert "displacement_2: not used, because a model of one axis describes one displacement" in done.out


@pytest.mark.parametrize("words", [("diagnose",), ("validate", "MODEL"), ("recalibrate", "MODEL")])
def test_coupled_axes_are_not_taken_for_one(piezo, words, coupled, of_one_axis, tmp_path):
    words = [of_one_axis if word == "MODEL" else word for word in words]
    output = () if words[0] == "validate" else ("-o", tmp_path / "new.yaml")
    assert "got the drives voltage, voltage_2, expected one" in refusal(piezo(*words, coupled, *output))
    assert not (tmp_path / "new.yaml").exists()


def test_every_other_command_says_that_it_handles_models_of_one_axis(piezo, coupled, tmp_path):
    model = tmp_path / "m.npz"
    assert piezo("identify", coupled, "-o", model, "--taps", 5).status == 0
    said = {
        refusal(done)
        for done in (
            piezo("diagnose", coupled, "--model", model),
            piezo("recalibrate", model, coupled, "-o", tmp_path / "new.yaml"),
            piezo("export", model, "-o", tmp_path / "c"),
            piezo("compensate", model, coupled, "-o", tmp_path / "command.npz"),
            piezo("report", coupled, "--model", model, "-o", tmp_path / "page.html"),
        )
    }
    (line,) = said
    assert "got an NPZ file, as a model of several axes is, expected a model file of one axis" in line


@pytest.mark.parametrize("words", [("--hysteresis", "bouc_wen"), ("--published",), ("--orders", "2", "2")])
def test_an_option_for_one_axis_is_refused_for_several(piezo, coupled, tmp_path, words):
    line = refusal(piezo("identify", coupled, "-o", tmp_path / "m.npz", "--taps", 5, *words))
    assert words[0] in line and "leave the option out" in line
    assert not (tmp_path / "m.npz").exists()


@pytest.mark.parametrize(("taps", "status", "words"), [(0, 2, "--taps: got 0"), (10**9, 1, "identify with fewer taps")])
def test_a_number_of_taps_that_the_record_cannot_determine_is_refused_at_once(
    piezo, coupled, tmp_path, taps, status, words
):
    done = piezo("identify", coupled, "-o", tmp_path / "m.npz", "--taps", taps)
    assert done.status == status and words in done.err


def test_a_model_of_one_axis_does_not_take_the_default_name_of_several(piezo, coupled, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").touch()
    assert piezo("identify", coupled, "--taps", 5).status == 0
    assert (tmp_path / "model.npz").exists()
    line = refusal(piezo("identify", coupled, "--taps", 5))
    assert "model.npz exists already" in line


@pytest.mark.parametrize("words", [("--figures", "drawn"), ("--one-zero",)])
def test_an_option_to_validate_one_axis_is_refused_for_several(piezo, coupled, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    assert piezo("identify", coupled, "-o", "m.npz", "--taps", 5).status == 0
    line = refusal(piezo("validate", "m.npz", coupled, *words))
    assert words[0] in line and "leave the option out" in line
    assert not (tmp_path / "drawn").exists()


def test_a_model_of_one_axis_gets_no_name_of_several(piezo, of_one_axis, tmp_path):
    t = PERIOD * np.arange(4000)
    u = 5.0 - 5.0 * np.cos(2.0 * np.pi * t)
    np.savez(tmp_path / "one.npz", voltage=u, displacement=1e-6 * u, sample_period=PERIOD)
    name = tmp_path / "m.npz"
    for words in (("identify",), ("recalibrate", of_one_axis), ("diagnose",)):
        line = refusal(piezo(*words, tmp_path / "one.npz", "-o", name))
        assert "give it a name that ends in .yaml" in line
    assert not name.exists()


@pytest.mark.parametrize("content", ["model", "hello", "record"])
def test_a_file_that_is_no_model_of_several_axes_is_called_that(piezo, coupled, of_one_axis, tmp_path, content):
    path = tmp_path / "m.npz"
    path.write_bytes({"model": of_one_axis.read_bytes(), "hello": b"hello", "record": coupled.read_bytes()}[content])
    line = refusal(piezo("validate", path, coupled))
    assert "expected a model of several axes, as piezo identify writes it" in line
    assert "pickle" not in line and "unsafely" not in line


def test_records_of_other_axes_are_told_apart_by_their_numbers(piezo, coupled, one_drive, tmp_path):
    done = piezo("identify", coupled, one_drive, "-o", tmp_path / "m.npz", "--phase", "noise")
    line = refusal(done, status=1)
    assert "record 2 (noise): got voltage, expected voltage, voltage_2 as in record 1 (noise)" in line
