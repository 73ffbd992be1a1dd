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

"""``piezo compensate``: from a path in a file to a command in a file, or a refusal that says what is reachable."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, SofteningOfOneMode
from piezo_hysteresis.identification.identified_range import identified_range
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.parameter import slew_text
from piezo_hysteresis.record import Record
from piezo_hysteresis.report.words import nanometre

PERIOD = 2e-5
MODEL = Model(
    (BoucWen(), Arx(a=[-1.2, 0.6], b=[0.05, 0.1, 0.05 / 3], delay=2)), PERIOD, 10.0, 1e-5, {"free_run_error": "5e-09"}
)


@pytest.fixture
def model(tmp_path):
    return model_file.save(MODEL, tmp_path / "model.yaml")


def write(place, low, high, period=PERIOD, duration=0.06):
    t = np.arange(round(duration / period)) * period
    y = low + (high - low) * 0.5 * (1.0 - np.cos(2 * np.pi * 50.0 * t))
    np.savetxt(place, np.c_[t, y], delimiter=",", header="time_s,displacement_um", comments="")
    return 1e-6 * y


def test_the_command_drives_the_model_along_the_path(piezo, model, tmp_path):
    wanted = write(tmp_path / "path.csv", 1.0, 3.0)
    words = ("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    done = piezo(*words, "--json", tmp_path / "plan.json", "--figures", tmp_path / "figures")
    assert done.status == 0, done.err
    answer = json.loads((tmp_path / "plan.json").read_text())
    with np.load(tmp_path / "command.npz") as held:
        u, begin = held["voltage"], int(held["path_begin"])
        np.testing.assert_allclose(held["wanted_displacement"], wanted, rtol=1e-12)
    reached, _ = MODEL.run(u, MODEL.rest(0.0))
    off = reached[begin : begin + wanted.size] - wanted
    assert np.sqrt(np.mean(off**2)) == pytest.approx(answer["expected_error"]["planned_m"])
    assert answer["expected_error"]["free_run_m"] == 5e-9 and answer["reachable"] is True
    assert "expected error" in done.out and (tmp_path / "figures" / "tracking.png").stat().st_size > 5000


def test_a_path_outside_of_what_the_model_was_identified_on_is_told(piezo, tmp_path):
    """The expected error was that of the data of the model: 0.06 % of the range, and 1 % in the end."""
    known = Record(*2 * (5.0 * np.sin(2.0 * np.pi * np.arange(500_000) * PERIOD),), PERIOD)
    stated = replace(MODEL, provenance={**MODEL.provenance, **identified_range((known,), (0,))})
    place = model_file.save(stated, tmp_path / "slow.yaml")
    write(tmp_path / "path.csv", 1.0, 3.0)
    words = ("compensate", place, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    done = piezo(*words, "--report", tmp_path / "page.html", "--json", tmp_path / "plan.json")
    assert "the model was identified up to" in done.out
    assert "the model was identified up to" in (tmp_path / "page.html").read_text()
    assert "the model was identified up to" in json.loads((tmp_path / "plan.json").read_text())["beyond_model"][0]


def test_what_an_earlier_drive_would_change_is_told(piezo, model, tmp_path):
    write(tmp_path / "path.csv", 1.0, 3.0)
    words = ("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz", "--json", tmp_path / "p.json")
    done = piezo(*words, "--report", tmp_path / "page.html")
    answer = json.loads((tmp_path / "p.json").read_text())
    assert answer["after_drive_m"] > answer["expected_error"]["total_m"]
    said = f"along the path differs by {nanometre(answer['after_drive_m'])} rms"
    assert said in done.out.replace("\n", " ") and said in (tmp_path / "page.html").read_text()


def test_terminal_page_and_json_contain_the_same_numbers(piezo, model, tmp_path):
    write(tmp_path / "path.csv", 1.0, 3.0)
    words = ("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz", "--json", tmp_path / "p.json")
    done = piezo(*words, "--report", tmp_path / "page.html")
    assert done.status == 0, done.err
    answer, page = json.loads((tmp_path / "p.json").read_text()), (tmp_path / "page.html").read_text()
    with np.load(tmp_path / "command.npz") as held:
        u = held["voltage"]
    assert u[-1] == u[0] == 0.0, "the way back"
    for text in (
        nanometre(answer["expected_error"]["total_m"]),
        nanometre(answer["expected_error"]["planned_m"]),
        slew_text(answer["largest_slew_V_per_s"], 4),
        f"{answer['voltage_min_V']:.4g} to {answer['voltage_max_V']:.4g} V",
    ):
        assert text in done.out and text in page
    assert answer["largest_slew_V_per_s"] == pytest.approx(np.abs(np.diff(u)).max() / PERIOD)
    assert "data:image/svg+xml" in page and "can follow the whole path" in page
    write(tmp_path / "path.csv", 0.0, 3.0)
    again = ("--force", "--report", tmp_path / "page.html")
    assert piezo(*words, *again).status == 1
    page = (tmp_path / "page.html").read_text()
    assert "do not allow the whole path" in page and "below voltage_min" in page


def test_an_unreachable_path_writes_nothing_and_proposes_a_reachable_one(piezo, model, tmp_path):
    write(tmp_path / "path.csv", 0.0, 3.0)
    words = ("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    done = piezo(*words)
    assert done.status == 1 and not (tmp_path / "command.npz").exists()
    assert "below voltage_min" in done.out and "if it is shifted by +" in done.out
    done, partial = done.out.splitlines()[-1], piezo(*words, "--allow-partial")
    assert partial.status == 1
    for last in (done, partial.out.splitlines()[-1]):
        assert last.startswith("A part of the path cannot be reached"), "the last line gives the reason of the status"
    with np.load(tmp_path / "command.npz") as held:
        assert held["voltage"].min() >= 0.0


def test_a_slower_path_is_interpolated_and_a_faster_one_refused(piezo, model, tmp_path):
    write(tmp_path / "slow.csv", 1.0, 3.0, period=1e-3)
    done = piezo("compensate", model, tmp_path / "slow.csv", "-o", tmp_path / "c.npz")
    assert done.status == 0 and "interpolated" in done.out
    write(tmp_path / "fast.csv", 1.0, 3.0, period=1e-5)
    done = piezo("compensate", model, tmp_path / "fast.csv", "-o", tmp_path / "other.npz")
    assert done.status == 2 and "or more" in done.err


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("time_s,voltage_V\n0,1\n", "displacement"),
        ("time_s,displacement_um\n0,1\n1,x\n", "numbers"),
        ("time_s,displacement_um\n0,1\n1,2\n5,3\n", "evenly"),
        ("displacement_um\nnan\n", "finite"),
        ("", "displacement"),
    ],
)
def test_a_file_without_a_path_is_bad_input(piezo, model, tmp_path, text, reason):
    (tmp_path / "path.csv").write_text(text)
    done = piezo("compensate", model, tmp_path / "path.csv")
    assert done.status == 2 and reason in done.err


@pytest.mark.parametrize(
    ("header", "encoding"),
    [
        ("time_s,displacement_um", "utf-8-sig"),
        ("t_s,displacement_um", "utf-8"),
        ("Zeit [s],displacement_µm", "latin-1"),
    ],
)
def test_times_under_other_titles_and_encodings_count(piezo, model, tmp_path, header, encoding):
    """A path whose times are not found would be played at the rate of the model, here fifty times too fast."""
    rows = "".join(f"{0.001 * k:g},{2.0 + np.sin(0.1 * k):.6f}\n" for k in range(100))
    (tmp_path / "path.csv").write_text(f"{header}\n{rows}", encoding=encoding)
    done = piezo("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    assert done.status == 0, done.err
    with np.load(tmp_path / "command.npz") as held:
        assert held["wanted_displacement"].size == 1 + round(0.099 / PERIOD)


def test_rows_without_times_are_at_the_rate_of_the_model_which_is_said(piezo, model, tmp_path):
    rows = "\n".join(f"{2.0 + 0.001 * k:g}" for k in range(100))
    (tmp_path / "path.csv").write_text(f"displacement_um\n{rows}\n")
    done = piezo("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    assert done.status == 0 and "the path has no times" in done.out, done.err
    (tmp_path / "path.csv").write_text("sample,displacement_um\n0,1\n1,1\n")
    done = piezo("compensate", model, tmp_path / "path.csv", "-o", tmp_path / "other.npz")
    assert done.status == 2 and "expected one for the time" in done.err and done.err.count("\n") == 1


@pytest.mark.parametrize("cut", [0, 100])
def test_a_damaged_npz_is_bad_input(piezo, model, tmp_path, cut):
    np.savez(tmp_path / "whole.npz", displacement=np.ones(100))
    (tmp_path / "path.npz").write_bytes((tmp_path / "whole.npz").read_bytes()[:cut])
    done = piezo("compensate", model, tmp_path / "path.npz", "-o", tmp_path / "command.npz")
    assert done.status == 2 and "path.npz" in done.err and done.err.count("\n") == 1


@pytest.mark.parametrize("period", [np.nan, 0.0, -1e-3])
def test_an_impossible_sample_period_is_bad_input(piezo, model, tmp_path, period):
    np.savez(tmp_path / "path.npz", displacement=np.full(100, 1e-6), sample_period=period)
    done = piezo("compensate", model, tmp_path / "path.npz", "-o", tmp_path / "command.npz")
    assert done.status == 2 and "expected a positive time" in done.err


def test_an_effect_without_an_inverse_is_refused_by_name(piezo, tmp_path):
    softened = replace(MODEL, effects=(*MODEL.effects, SofteningOfOneMode(k3=0.05)))
    path = model_file.save(softened, tmp_path / "softened.yaml")
    write(tmp_path / "path.csv", 1.0, 3.0)
    words = ("compensate", path, tmp_path / "path.csv", "-o", tmp_path / "command.npz")
    done = piezo(*words)
    assert done.status == 2 and "softening_of_one_mode" in done.err
    done = piezo(*words, "--approximate", "--json", tmp_path / "plan.json")
    assert done.status == 0 and "left out" in done.out
    assert json.loads((tmp_path / "plan.json").read_text())["expected_error"]["planned_m"] > 1e-11
