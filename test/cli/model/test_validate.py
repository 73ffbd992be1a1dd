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

"""``piezo validate`` of a stage that was driven before the record, unlike before those of its model."""

import json

import numpy as np
import pytest

from piezo_hysteresis.cli.main import main
from piezo_hysteresis.effects import Arx, BoucWen, HysteresisMemory
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import write


@pytest.mark.parametrize("turns", [(), (1.0, 0.0)])
def test_the_state_before_the_record_is_named_where_it_is_the_cause(turns, tmp_path):
    linear, dynamics = BoucWen(A=0.0, gamma=0.0, p1=0.0, p2=1.4), Arx(a=(-0.5,), b=(0.5,), delay=1.0)
    plays = HysteresisMemory(c=(0.02,) * 6, reach=0.9, virgin=1.0)
    u = np.interp(np.arange(2000.0), (0, 600, 1000, 1500, 1999), (0.0, 10.0, 3.0, 7.0, 0.0))

    def stage(plays):
        return Model((linear, plays, dynamics), 1e-3, 10.0, 1e-5)

    (y,) = stage(plays.with_values(turns=turns)).free_run([Record(u, u, 1e-3)])
    noise = 2e-9 * np.random.default_rng(0).normal(size=u.size)
    write(Experiment((Record(u, y + noise, 1e-3, "loops"),)), tmp_path / "record.csv")
    model_file.save(stage(plays), tmp_path / "model.yaml")
    model, record, answer = (str(tmp_path / name) for name in ("model.yaml", "record.csv", "said.json"))
    main(["validate", model, record, "--json", answer])
    said = json.loads((tmp_path / "said.json").read_text())
    found = [n["message"] for n in said["notices"] if n["kind"] == "state_at_rest"]
    if not turns:
        assert not found
    else:
        (message,) = found
        assert "driven before to 10 V and then to 0 V" in message
        assert float(message.split("leaves ")[1].split(" %")[0]) < 0.1 < said["percent_of_range"]
