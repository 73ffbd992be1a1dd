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

"""The table holds one row per recording and task, the newest, after any sequence of writing, merging and dying."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta

import pytest

pytest.importorskip("pyarrow")

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.fleet.table.results import MERGED, Results, read_results

EPOCH = datetime(2026, 11, 1, tzinfo=UTC)


def row(recording: str, number: int, stage: str = "a", month: str = "2026-11") -> dict[str, object]:
    return {
        "recording": recording, "task": "identify", "stage": stage, "month": month, "status": "done",
        "finished_at": EPOCH + timedelta(seconds=number), "samples": number, "data_hash": f"sha256:{number}",
    }  # fmt: skip


def held(folder) -> dict[str, tuple[int, str]]:
    rows = read_results(folder, ["recording", "samples", "stage"]).to_pylist()
    assert len(rows) == len({r["recording"] for r in rows})
    return {r["recording"]: (r["samples"], r["stage"]) for r in rows}


class DeathError(Exception):
    pass


@pytest.mark.parametrize("seed", range(12))
def test_one_row_each_whatever_happens(tmp_path, seed, monkeypatch):
    """Rows are added, replaced and moved to other stages; the process dies between any two files."""
    chance, number = random.Random(seed), 0
    expected: dict[str, tuple[int, str]] = {}
    steps = 0

    def unlink(self, missing_ok=False):
        nonlocal steps
        steps -= 1
        if steps == 0:
            raise DeathError
        original(self, missing_ok)

    original = type(tmp_path).unlink
    for _ in range(6):
        steps = chance.randint(1, 12)
        try:
            monkeypatch.setattr(type(tmp_path), "unlink", unlink)
            with Results(tmp_path) as results:
                for _ in range(chance.randint(1, 8)):
                    for _ in range(chance.randint(1, 5)):
                        number += 1
                        recording, stage = f"r{chance.randint(0, 9)}", chance.choice("abc")
                        results.add(row(recording, number, stage))
                        expected[recording] = (number, stage)
                    results.flush()
                    if chance.random() < 0.3:
                        results.merge()
        except DeathError:
            monkeypatch.setattr(type(tmp_path), "unlink", original)
        monkeypatch.setattr(type(tmp_path), "unlink", original)
        with Results(tmp_path) as results:
            assert {url: known.data_hash for (_, url), known in results.known.items()} == {
                url: f"sha256:{n}" for url, (n, _) in held(tmp_path).items()
            }
        assert held(tmp_path) == expected
        assert {file.name for file in tmp_path.rglob("*.parquet")} == {MERGED}


def test_strange_names_of_stages_come_back(tmp_path):
    with Results(tmp_path) as results:
        results.add(row("x", 1, "a/b=ü %2F", "unknown"))
    assert held(tmp_path) == {"x": (1, "a/b=ü %2F")}


def test_two_processes_do_not_write_to_one_folder(tmp_path):
    with Results(tmp_path), pytest.raises(RecordingError, match="another process"), Results(tmp_path):
        pass


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="got no results"):
        read_results(tmp_path)


def test_whole_rows_are_found_again(tmp_path):
    with Results(tmp_path) as results:
        results.add(row("x", 1))
        results.add(row("y", 2, "b"))
        results.flush()
        (found,) = results.rows([("identify", "y")])
    assert (found["samples"], found["stage"], found["month"]) == (2, "b", "2026-11")
