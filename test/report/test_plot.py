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

"""What a notebook shows: one line per record, tables, and the figure of each result."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import piezo_hysteresis as piezo
from piezo_hysteresis import Experiment, Model, Record
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import RecordError

ROOT = Path(__file__).parents[2]
MODEL = Model((Arx(a=[-0.5], b=[0.5]), BoucWen()), 1e-3, displacement_scale=1e-5)
DRIVE = 5.0 - 5.0 * np.cos(np.arange(2000) / 100.0)
RECORD = Record(DRIVE, MODEL.simulate(DRIVE), 1e-3, phase="sine_<b>")
EXPERIMENT = Experiment((RECORD, RECORD[1000:]))


def test_a_record_is_one_line_and_an_experiment_one_line_for_each():
    assert repr(RECORD).startswith("Record(sine_<b>, 2000 samples of 0.001 s, 0 to 10 V, ")
    assert "\n" not in repr(RECORD)
    assert repr(EXPERIMENT).splitlines()[0] == "Experiment of 2 phases, 3000 samples, 0 findings"
    assert len(repr(EXPERIMENT).splitlines()) == 3
    assert EXPERIMENT._repr_html_().count("<tr>") == 3
    assert "sine_&lt;b&gt;" in EXPERIMENT._repr_html_()


def test_a_model_names_its_chain_and_lists_its_numbers():
    assert repr(MODEL) == "Model(bouc_wen → arx, 0.001 s)"
    assert MODEL._repr_html_().count("<tr>") == 1 + len(MODEL.values())


@pytest.mark.parametrize("what", [(RECORD,), (EXPERIMENT,), (MODEL, EXPERIMENT)])
def test_plot_draws_it(what):
    drawing = piezo.plot(*what)
    assert "<svg" in drawing._repr_svg_()
    assert drawing.data
    with pytest.raises(RecordError, match=r"plot\(model, experiment\)"):
        piezo.plot(MODEL)


@pytest.mark.parametrize("drawn", [RECORD.plot, EXPERIMENT.plot, lambda: MODEL.plot(EXPERIMENT)])
def test_so_do_the_methods_and_the_picture_can_be_saved(drawn, tmp_path):
    picture = drawn()
    assert picture.data
    assert len(repr(picture)) < 200
    picture.save_picture(str(tmp_path / "look.png"))
    assert (tmp_path / "look.png").read_bytes().startswith(b"\x89PNG")


def test_matplotlib_is_imported_with_the_first_figure_only():
    code = "import sys, piezo_hysteresis as p; [getattr(p, n) for n in p.__all__ if n != 'plot']; "
    code += "r = p.Record([0.0, 1.0], [0.0, 1e-6], 1.0); before = 'matplotlib' in sys.modules; r.plot(); "
    command = [sys.executable, "-c", code + "sys.exit(before or 'matplotlib' not in sys.modules)"]
    assert subprocess.run(command, cwd=ROOT, check=False, timeout=120).returncode == 0
