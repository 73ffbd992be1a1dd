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

"""`piezo fleet` on one folder: rows, status, what is up to date, first-day errors."""

from __future__ import annotations

import shutil

import pytest

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")

from piezo_hysteresis.fleet.table.results import read_results


def test_a_folder_of_recordings(piezo, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "lab" / "stage_x" / "2026-11-03")
    model = "config/published_stage.yaml"
    command = ("fleet", tmp_path / "lab", "-o", tmp_path / "results", "--task", "validate", "--model", model)
    first = piezo(*command, "--workers", 1)
    assert first.status == 0, first.err
    assert "1 done" in first.out
    assert "dashboard at http://127.0.0.1:" in first.err
    (row,) = read_results(tmp_path / "results").to_pylist()
    assert (row["stage"], row["month"], row["task"], row["status"]) == ("stage_x", "2026-11", "validate", "done")
    again = piezo(*command)
    assert again.status == 0
    assert "recordings: 1; with an up-to-date row: 1" in again.out
    page = tmp_path / "fleet.html"
    drawn = piezo("fleet", "-o", tmp_path / "results", "--task", "validate", "--report", page)
    assert drawn.status == 0, drawn.err
    assert "1 of 1 recordings have a result" in page.read_text()
    (tmp_path / "lab" / "stage_y").mkdir()
    (tmp_path / "lab" / "stage_y" / "broken.csv").write_text("time_s,voltage_V,displacement_m\n0,1,x\n")
    broken = piezo(*command, "--workers", 1, "--report", page, "--force")
    assert broken.status == 1
    assert broken.out.splitlines()[-1].startswith("without a result: 1 of 2"), "the reason of the status"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--task", "validate"), "expected a model"),
        (("--model", "config/published_stage.yaml"), "expected no model"),
        (("--time-limit", "0"), "--time-limit"),
        (("--workers", "0"), "--workers"),
        (("--name", "("), "regular expression"),
        (("--report", "/nowhere/page.html"), "--report"),
    ],
)
def test_invalid_values_are_refused(piezo, folder, tmp_path, words, message):
    outcome = piezo("fleet", folder, "-o", tmp_path / "results", *words)
    assert outcome.status == 2
    assert message in outcome.err
    assert not (tmp_path / "results").exists()
