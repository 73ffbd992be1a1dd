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

"""Whatever text claims to be a model, an answer or a plant, it is one or it is refused in one line.

Memory: `tracemalloc` sees the arrays of numpy too. The files are of some kilobytes, and no number in them may buy more.
"""

import json
import tracemalloc
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.hostile_texts import hostile_texts
from piezo_hysteresis.cli.options.plant_option import _read as read_plant
from piezo_hysteresis.effects import CHAIN
from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.model import parameter_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps, load, loads
from piezo_hysteresis.model.parameter_file import LONGEST_TEXT
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.recording.segmentation.decimation import FILE, load_decimation
from piezo_hysteresis.report.json_file import read_json

ALL = Model(tuple(kind() for kind in CHAIN if kind.host is None), 2e-5)
TEXT = dumps(ALL)
LINES = TEXT.splitlines(keepends=True)
NUMBERS = st.sampled_from(
    ["0.0", "-0.0", "1.0e308", "1.0e-308", "5.0e-324", ".nan", ".inf", "-.inf", "1", "9" * 5000, "0x" + "f" * 5000]
    + ["1.0e-12", "1.0e12", "true", "[]", "[1.0, 2.0]", "[" + "0.1, " * 50 + "0.1]", "'1.0'", "2001-99-99", "~", "*a"]
)
SETTINGS = settings(max_examples=100, suppress_health_check=list(HealthCheck))


def or_refused(function, *arguments):
    """What a function gives, or None where it refuses in one line."""
    try:
        return function(*arguments)
    except PiezoError as error:
        message = str(error)
    assert "\n" not in message
    assert len(message) < 6000
    return None


@contextmanager
def memory_below(limit):
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < limit
    finally:
        tracemalloc.stop()


@settings(SETTINGS, max_examples=25)
@given(
    st.lists(st.tuples(st.integers(0, len(LINES) - 1), NUMBERS), min_size=1, max_size=4),
    st.sampled_from([1e-7, 2e-5, 1e-2]),
)
def test_a_model_of_extreme_numbers_is_refused_or_runs(changes, period):
    """With the hash taken out, so that the numbers themselves are looked at; and then it follows a stream."""
    lines = [line for line in LINES if " hash:" not in line]
    for at, value in changes:
        key, colon, _ = lines[at % len(lines)].partition(":")
        lines[at % len(lines)] = f"{key}{colon} {value}\n"
    with memory_below(300e6), np.errstate(all="ignore"):
        model = or_refused(loads, "".join(lines))
        if model is None:
            return
        predictor = or_refused(Predictor, period, model)
        for block in range(3 if predictor is not None else 0):
            voltage = np.linspace(0.0, 9.0, 50)
            answer = or_refused(predictor.predict, 50 * block, 0, voltage, 1e-6 * voltage)
            assert answer is None or np.isfinite(answer.prediction).all()


@SETTINGS
@given(st.lists(st.tuples(st.integers(0, len(TEXT)), st.integers(0, 40), st.text(max_size=8)), min_size=1, max_size=5))
def test_any_change_of_a_model_file_is_refused_or_read(changes):
    text = TEXT
    for at, length, new in changes:
        text = text[:at] + new + text[at + length :]
    or_refused(loads, text)


@SETTINGS
@given(st.text() | st.text("{}[]&*!|>'\"%@`:-? \n\tax10.e", max_size=60))
def test_any_text_is_refused_or_read(text):
    assert or_refused(loads, text) is None


def test_aliases_in_one_another_are_refused_at_once():
    """Nine letters a line, 10⁹ parameters."""
    rows = ["x0: &x0 {a: 1.0}"]
    rows += [f"x{k}: &x{k} {{{', '.join(f'{c}: *x{k - 1}' for c in 'abcdefghij')}}}" for k in range(1, 9)]
    with memory_below(20e6), pytest.raises(PiezoError, match="alias"):
        loads("/**: {ros__parameters: {model: {" + ", ".join(rows) + "}}}")


@pytest.mark.parametrize("name", hostile_texts(TEXT))
def test_a_text_made_to_harm_is_refused(name):
    with memory_below(100e6), pytest.raises(PiezoError) as refusal:
        loads(hostile_texts(TEXT)[name], "topic 'model'")
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


@pytest.mark.parametrize("name", ["deep brackets", "keys without number", "a list without end", "merged aliases"])
def test_a_text_that_is_long_to_parse_is_given_up_before_it_is_put_together(name, monkeypatch):
    """The time of a parser grows with the square of depth and number: they are counted first."""
    monkeypatch.setattr(parameter_file.yaml, "compose", lambda *_, **__: pytest.fail("was put together"))
    with pytest.raises(PiezoError, match=r"too deeply|more than 50000 entries|alias"):
        loads(hostile_texts(TEXT)[name])


def test_texts_without_end_are_refused_unread():
    with memory_below(50e6):
        with pytest.raises(PiezoError, match="characters"):
            loads("#" * (LONGEST_TEXT + 1))
        with pytest.raises(PiezoError):
            load("/dev/zero")


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)


@SETTINGS
@given(content=json_like.map(json.dumps).map(str.encode) | st.binary(max_size=60) | st.just(b"[" * 100_000))
def test_an_answer_is_an_object_or_refused(tmp_path, content):
    file = tmp_path / "answer.json"
    file.write_bytes(content)
    answer = or_refused(read_json, str(file))
    assert answer is None or isinstance(answer, dict)


yaml_like = json_like.map(json.dumps) | st.text(max_size=60) | NUMBERS.map(lambda n: f"hysteresis.alpha: {n}")


@SETTINGS
@given(content=yaml_like)
def test_a_plant_and_a_decimation_are_read_or_refused(tmp_path: Path, content):
    file = tmp_path / FILE
    file.write_text(content, encoding="utf-8", errors="replace")
    or_refused(read_plant, str(file))
    factors = or_refused(load_decimation, tmp_path)
    assert factors is None or all(n >= 1 for n in factors.values())
