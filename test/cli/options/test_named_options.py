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

"""A refused option is named as it was typed, and an option without effect is reported."""

from __future__ import annotations

import json

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model


@pytest.mark.parametrize(
    "words",
    [
        "compensate {model} {path} -o {new} --max-slew-rate 0",
        "compensate {model} {path} -o {new} --way-back -1",
        "compensate {model} {path} -o {new} --way-back 1e9",
        "compensate {model} {path} -o {new} --rest-voltage nan",
        "export {model} -o {new} --max-slew-rate=nan",
        "identify {path} -o {new} --orders 0 0",
        "identify {path} -o {new} --held-out nosuch",
        "identify {path} -o {new} --unit nosuch=2",
        "identify {path} -o {new} --decimate sine_1.6hz=0",
        "calibrate Dev1 -o {new} --amplitude -1",
        "view {path} --no-browser --port 99999",
    ],
)
def test_a_value_that_is_refused_is_named_by_its_option(piezo, tmp_path, words):
    model, path = tmp_path / "model.yaml", tmp_path / "path.csv"
    model_file.save(Model((BoucWen(), Arx()), 1e-3, 10.0, 1e-5), model)
    rows = (f"{k / 1e3},{5 - 5 * np.cos(k / 100)},{5 - 5 * np.cos(k / 100)}" for k in range(2000))
    path.write_text("time_s,voltage_V,displacement_um\n" + "\n".join(rows))
    done = piezo(*words.format(model=model, path=path, new=tmp_path / "new").split())
    option = next(word for word in words.split()[::-1] if word.startswith("--")).partition("=")[0]
    assert done.status == 2
    assert done.err.splitlines()[-1].startswith(f"piezo: {option}: got")


@pytest.mark.parametrize("option", ["--orders 2 2", "--choose-orders"])
def test_identify_says_that_orders_have_no_effect_on_loops(piezo, folder, tmp_path, option):
    words = (*option.split(), "--no-memory", "-o", tmp_path / "model.yaml", "--json", tmp_path / "model.json")
    done = piezo("identify", folder / "04_triangle.npz", *words)
    message = f"{option.split()[0]} has no effect"
    assert message in done.out
    assert any(message in notice["message"] for notice in json.loads((tmp_path / "model.json").read_text())["notices"])
