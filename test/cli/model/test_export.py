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

"""``piezo export``: a model file becomes a program, or a refusal in one line."""

from __future__ import annotations

import subprocess
import zipfile

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, SofteningOfOneMode
from piezo_hysteresis.model import axes_file, model_file
from piezo_hysteresis.model.axes_model import AxesModel
from piezo_hysteresis.model.model import Model

from ...contract.compiled import needs_compiler

MODEL = Model((BoucWen(), Arx(a=[-1.2, 0.6], b=[0.3, 0.1], delay=2)), 2e-5, 10.0, 1e-5)


@pytest.fixture
def model(tmp_path):
    return model_file.save(MODEL, tmp_path / "model.yaml")


@needs_compiler
def test_the_files_pass_the_check_that_it_prints(piezo, model, tmp_path):
    done = piezo("export", model, "--to", "c", "-o", tmp_path / "c", "--name", "stage_x")
    assert done.status == 0, done.err
    (check,) = (line for line in done.out.splitlines() if line.startswith("check: "))
    ran = subprocess.run(
        check.removeprefix("check: ").replace("cc ", "gcc ", 1), shell=True, cwd=tmp_path / "c", capture_output=True,
        check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert {p.suffix for p in (tmp_path / "c").iterdir()} >= {".h", ".c"}


def test_existing_files_are_kept_without_force(piezo, model, tmp_path):
    words = ("export", model, "-o", tmp_path / "c")
    assert piezo(*words).status == 0
    (tmp_path / "c" / "piezo.h").write_text("mine")
    refused = piezo(*words)
    assert refused.status == 2 and "--force" in refused.err and len(refused.err.splitlines()) == 1
    assert (tmp_path / "c" / "piezo.h").read_text() == "mine"
    assert piezo(*words, "--force").status == 0
    assert "PIEZO_MODEL_HASH" in (tmp_path / "c" / "piezo.h").read_text()


def test_models_that_cannot_be_exported_are_refused_in_one_line(piezo, tmp_path):
    axes = AxesModel(np.zeros((1, 2, 3, 8)), np.eye(2), np.ones(1), np.zeros(2), 1e-3, 1.0, 0.1)
    place = axes_file.save(axes, tmp_path / "axes.npz")
    refused = piezo("export", place, "-o", tmp_path / "c")
    assert refused.status == 2 and "several axes" in refused.err and len(refused.err.splitlines()) == 1
    assert not (tmp_path / "c").exists()
    refused = piezo("export", tmp_path / "none.yaml", "-o", tmp_path / "c")
    assert refused.status == 2 and "none.yaml" in refused.err


def test_a_model_without_an_inverse_is_written_without_it_and_this_is_reported(piezo, tmp_path):
    model = model_file.save(MODEL.with_effect(SofteningOfOneMode(k3=0.02)), tmp_path / "soft.yaml")
    done = piezo("export", model, "-o", tmp_path / "c")
    assert done.status == 0 and "no inverse was written: softening_of_one_mode" in done.out
    assert "inverse" not in (tmp_path / "c" / "piezo.h").read_text()


def test_co_simulation_units_are_written_and_kept(piezo, model, tmp_path):
    words = ("export", model, "--to", "fmu", "-o", tmp_path / "units", "--name", "stage_x")
    done = piezo(*words)
    assert done.status == 0 and "wrote stage_x.fmu, stage_x_inverse.fmu" in done.out, done.err
    with zipfile.ZipFile(tmp_path / "units" / "stage_x.fmu") as unit:
        description = unit.read("modelDescription.xml").decode()
    assert 'fmiVersion="3.0"' in description and 'fixedInternalStepSize="2e-05"' in description
    assert piezo(*words).status == 2 and piezo(*words, "--force").status == 0


def test_no_inverse_of_an_earlier_model_remains_beside_a_unit(piezo, model, tmp_path):
    words = ("--to", "fmu", "-o", tmp_path / "units")
    assert piezo("export", model, *words).status == 0
    soft = model_file.save(MODEL.with_effect(SofteningOfOneMode(k3=0.02)), tmp_path / "soft.yaml")
    done = piezo("export", soft, *words, "--force")
    assert done.status == 0 and "removed piezo_inverse.fmu" in done.out, done.err
    assert [unit.name for unit in (tmp_path / "units").iterdir()] == ["piezo.fmu"]


def test_a_failing_compiler_is_reported_in_one_line(piezo, model, tmp_path, monkeypatch):
    (tmp_path / "broken").write_text("#!/bin/sh\necho no licence >&2\nexit 1\n")
    (tmp_path / "broken").chmod(0o755)
    monkeypatch.setenv("CC", str(tmp_path / "broken"))
    refused = piezo("export", model, "--to", "fmu", "-o", tmp_path / "units")
    assert refused.status == 2 and "no licence" in refused.err and len(refused.err.splitlines()) == 1


def test_limits_and_band_of_the_inverse_are_those_of_the_options(piezo, model, tmp_path):
    words = ("export", model, "--voltage-min", "-2", "--voltage-max", "8", "--max-slew-rate", "5e4")
    long, short = (piezo(*words, "-o", tmp_path / name, *more) for name, more in (("a", ()), ("b", ("--no-band",))))
    assert "known 102 samples (0.00204 s) ahead" in long.out and "known 2 samples" in short.out
    header = (tmp_path / "b" / "piezo.h").read_text()
    assert "-2.0 V to 8.0 V and 50000.0 V/s" in header and "It is exact to rounding." in header
    assert piezo("export", model, "-o", tmp_path / "d", "--no-inverse").status == 0
    assert "inverse" not in (tmp_path / "d" / "piezo.h").read_text()


def test_an_invalid_name_is_refused(piezo, model, tmp_path):
    refused = piezo("export", model, "-o", tmp_path / "c", "--name", "My Stage")
    assert refused.status == 2 and "My Stage" in refused.err and not (tmp_path / "c").exists()
