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

"""A real piezo, picma-p885: everything is chosen on rows 0 to 7000 of one record, another is predicted from 0 V.

One constant is free per record, as everywhere.
"""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.cli.main import main
from piezo_hysteresis.discrepancy import Verdict, diagnose
from piezo_hysteresis.effects import ThermalDrift
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.steps.remaining_lag import amplifier_of

SETTLED = 1000


@pytest.fixture(scope="module")
def folder():
    for place in (os.environ.get("PIEZO_DATA", ""), Path(__file__).parents[3] / "shared" / "data"):
        if place and (path := Path(place) / "picma-p885").is_dir():
            return path
    pytest.skip("no measured data: neither PIEZO_DATA nor ../shared/data holds picma-p885")


def read(path, **options):
    channels = {"columns": {"voltage": 1, "displacement": 5}, "units": {"displacement": "um"}}
    return recording.read(path, **channels, sample_period=5e-3, initial_voltage=0.0, **options)


@pytest.fixture(scope="module")
def fitted(folder):
    return read(folder / "Model_Vi_Do.dat", rows=(0, 7000))


@pytest.fixture(scope="module")
def unseen(folder):
    return read(folder / "Test_Vi_Do_Di.dat", phases="test")


@pytest.fixture(scope="module")
def identified(fitted):
    return identify(fitted, memory=True)


@pytest.fixture(scope="module")
def diagnosed(fitted):
    return diagnose(fitted)


def settled_percent(model, experiment):
    found = errors(model, experiment)
    return 100.0 * float(np.sqrt(np.mean(found.residuals[0][SETTLED:] ** 2))) / found.range


def test_plays_foretell_other_amplitudes(identified, fitted, unseen):
    assert "hysteresis_memory" in identified.model
    assert identified.model["hysteresis_memory"].array("c").min() >= 0.0
    assert settled_percent(identified.model, fitted) <= 0.25
    assert errors(identified.model, unseen).percent <= 0.5


def test_the_bouc_wen_state_does_not(fitted, unseen, identified):
    alone = identify(fitted).model
    assert "hysteresis_memory" not in alone
    assert errors(alone, unseen).percent > 1.2 * errors(identified.model, unseen).percent


def test_delay_and_pole_come_from_the_first_moments(identified):
    assert identified.model["arx"]["delay"] == pytest.approx(1.0, abs=0.3)
    assert amplifier_of(identified.model)["tau"] == pytest.approx(13e-3, abs=2e-3)


def test_the_page_states_the_numbers_of_its_commands(identified, diagnosed, folder):
    """It stated another creep, and the lag of the whole file beside the rows."""
    page = (Path(__file__).parents[2] / "docs" / "real_recordings.md").read_text(encoding="utf-8")
    creep, lag, whole = (
        float(re.search(rf"{words}([\d.]+){unit}", page)[1])
        for words, unit in (
            (r"Creep of one rate, ", " % per decade"),
            (r"For the rows above it is ", " ms"),
            (r"\(", r" ms for the whole\s+record\)"),
        )
    )
    for model in (identified.model, diagnosed.model):
        assert 100.0 * model["creep"]["gamma"] == pytest.approx(creep, abs=0.02)
    for read_lag, rows in ((lag, (0, 7000)), (whole, None)):
        (notice,) = (n for n in read(folder / "Model_Vi_Do.dat", rows=rows).notices if n.kind == "late")
        assert f"by {read_lag / 1e3:.4g} s" in notice.message


@pytest.mark.soak
def test_drift_in_addition_to_creep_does_not_increase_the_error(fitted, unseen):
    found = diagnose(fitted, effects=(ThermalDrift,))
    assert settled_percent(found.model, fitted) <= 0.32
    assert errors(found.model, unseen).percent <= 0.65


def test_the_gap_finder_extends_the_model_and_gives_no_name(diagnosed, fitted, unseen):
    assert diagnosed.verdict is Verdict.UNKNOWN
    assert diagnosed.names == ()
    assert "hysteresis_memory" in diagnosed.reason
    assert settled_percent(diagnosed.model, fitted) <= 0.32
    assert errors(diagnosed.model, unseen).percent <= 0.65


def test_the_commands_do_the_same(folder, tmp_path, capsys):
    options = ["--column", "voltage=1", "--column", "displacement=5", "--unit", "displacement=um"]
    options += ["--sample-period", "0.005", "--initial-voltage", "0"]
    model = str(tmp_path / "model.yaml")
    assert main(["identify", str(folder / "Model_Vi_Do.dat"), *options, "--rows", "0:7000", "-o", model]) == 0
    assert "hysteresis_memory" in capsys.readouterr().out
    assert main(["validate", model, str(folder / "Test_Vi_Do_Di.dat"), *options, "--phase", "test"]) == 0
    said = capsys.readouterr().out
    assert "The model describes this stage" in said and "of which none was left out" in said, "all was fitted"
    row = next(line for line in said.splitlines() if line.startswith("test "))
    assert float(row.split()[3]) <= 0.65
