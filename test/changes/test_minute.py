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

"""The samples of a recalibration are simulated from the same past as the live prediction."""

import numpy as np
import pytest

from piezo_hysteresis.changes.minute import Minute
from piezo_hysteresis.effects import Arx, BoucWen, Creep
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.predictor import Predictor

PERIOD, BLOCK = 2e-3, 50


@pytest.mark.parametrize("seconds", [20.0, 100.0])
def test_creep_of_a_long_hold_belongs_to_the_past_of_the_minute(tmp_path, seconds: float) -> None:
    """After an hour at one voltage, the fitted samples had 64 nm of creep that the live prediction does not have."""
    model = Model((BoucWen(), Creep(gamma=0.02), Arx(b=(0.5,))), PERIOD, displacement_scale=1e-5)
    time = PERIOD * np.arange(round(seconds / PERIOD))
    drive = np.where(time < 0.6 * seconds, 3.5 + 2.5 * np.sin(2.0 * np.pi * 1.1 * np.maximum(0.0, time - 0.2)), 6.0)
    predictor, hold = Predictor(PERIOD, model), round(3600.0 / PERIOD)

    def feed(voltage: np.ndarray, begin: int) -> np.ndarray:
        parts = []
        for first in range(0, voltage.size, BLOCK):
            index, part = begin + first, voltage[first : first + BLOCK]
            answer = predictor.predict(index, round(index * PERIOD * 1e9), part, np.zeros(part.size), follows_gap=True)
            parts.append(answer.prediction - predictor.offset)
        return np.concatenate(parts)

    feed(drive, 0)
    recent = feed(drive[::-1], drive.size + hold)[-round(40.0 / PERIOD) :]
    Minute(predictor.drive, recent, 0.0).save(tmp_path / "minute.npz")
    scores = Minute.load(tmp_path / "minute.npz").scores(model, 0.0)
    assert max(abs(score.offset) for score in scores) < 1e-10
