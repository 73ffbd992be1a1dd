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

"""``piezo effects`` prints what the classes say."""

import argparse
import io

import pytest
from rich.cells import cell_len
from rich.console import Console

from piezo_hysteresis.cli.model import effects
from piezo_hysteresis.effects import CHAIN, UNNAMED
from piezo_hysteresis.errors import ModelError


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    parser = argparse.ArgumentParser()
    effects.add_parser(parser.add_subparsers())
    args = parser.parse_args(["effects", *arguments])
    assert args.run(args) == 0
    return " ".join(capsys.readouterr().out.split())


def test_the_list_names_every_effect(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    out = printed(capsys)
    assert not any(correction.name in out for correction in UNNAMED)
    for effect in (e for e in CHAIN if e not in UNNAMED):
        assert effect.name in out
        assert effect.family in out


@pytest.mark.parametrize("effect", CHAIN, ids=lambda e: e.name)
def test_one_effect_gives_equation_source_and_parameters(
    effect, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    out = printed(capsys, effect.name)
    for text in (effect.equation, effect.signature, effect.source, *(p.meaning for p in effect.parameters)):
        assert " ".join(text.split()) in out


def test_an_unknown_name_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ModelError, match="unknown effect 'crep'"):
        printed(capsys, "crep")


def test_the_catalogue_fits_a_narrow_terminal_and_names_stay_whole() -> None:
    output = io.StringIO()
    Console(file=output, width=80).print(effects.listing())
    text = output.getvalue()
    assert max(map(cell_len, text.splitlines())) <= 80
    assert "…" not in text
    last = "".join(line.split("│")[4] for line in text.splitlines() if line.count("│") == 5).replace(" ", "")
    for effect in CHAIN:
        assert effect in UNNAMED or f" {effect.name} " in text
        assert effect in UNNAMED or "".join(effect.signature.split()) in last, "nothing is cut off"
