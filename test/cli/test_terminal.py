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

"""Tables on a terminal end their lines between words; in a file they take the width that they need."""

import io
import re

import pytest

from piezo_hysteresis.cli.terminal import console, show
from piezo_hysteresis.report.tables.answer_tables import effect_table, rejection_table, where_table

NAMES = ("extra_resonance", "amplifier_bandwidth", "softening_of_one_mode", "rate_dependent_hysteresis")
ANSWER = {
    "effects": [
        {
            "name": "creep",
            "family": "creep",
            "explained_fraction": 0.97,
            "confusable_with": ["thermal_drift", "creep_fractional"],
            "parameters": {"gamma": {"value": 0.01499, "interval_95": [0.01465, 0.01532], "unit": "1/decade"}},
        }
    ],
    "where": [{"axis": "phase", "share": 0.64, "detail": "triangle (32 %), step (20 %), minor_loops (12 %) " * 3}],
    "rejected": [{"name": name, "reason": "in cross-validation it does not reduce the error"} for name in NAMES],
}


class Terminal(io.StringIO):
    """Standard output that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


def printed(monkeypatch, out: io.StringIO) -> str:
    monkeypatch.setattr("sys.stdout", out)
    show(effect_table(ANSWER), where_table(ANSWER), rejection_table(ANSWER))
    console().print("A sentence " + "with many short words " * 9)
    return out.getvalue()


@pytest.mark.parametrize("columns", [80, 100])
def test_tables_and_sentences_fit_a_terminal_and_break_no_word(monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    words = set(printed(monkeypatch, io.StringIO()).split())
    text = re.sub(r"\x1b\[[0-9;]*m", "", printed(monkeypatch, Terminal()))
    width = max(len(line.rstrip()) for line in text.splitlines())
    assert columns - 15 < width <= columns
    assert set(text.split()) == words
    assert "0.01465 … 0.01532" in text or "0.01465 …\n" in text, "a number stands on one line"


def test_rows_are_whole_in_a_file(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = printed(monkeypatch, io.StringIO()).splitlines()
    assert any(line.startswith("4 effects") and all(name in line for name in NAMES) for line in lines)
    assert all(line == line.rstrip() for line in lines[:-1]), "no blanks up to the width of the widest row"
