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

"""Slow relaxations leave the dynamics; modes, delay, dc gain and a slow amplifier stay."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.records.intersample_error import quick_dynamics
from piezo_hysteresis.model.model import Model

PERIOD = 2e-5
MODE = np.poly(np.exp(PERIOD * 2.0 * np.pi * 1400.0 * np.array([-0.1 + 1j, -0.1 - 1j]))).real
FREQUENCIES = np.array([0.0, 300.0, 1400.0, 5000.0])


def stage(a: np.ndarray, b: np.ndarray) -> Model:
    return Model((BoucWen(), Arx(a=tuple(a[1:]), b=tuple(b), delay=3.0)), PERIOD, 10.0, 1e-5)


def relaxation(frequency: float, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Denominator and numerator of a relaxation that adds `share` to a response of one."""
    pole = np.exp(-2.0 * np.pi * frequency * PERIOD)
    zero = 1.0 - (1.0 - pole) / (1.0 - share)
    return np.array([1.0, -pole]), np.array([1.0, -zero]) * (1.0 - pole) / (1.0 - zero)


def test_two_slow_relaxations_leave_and_the_mode_stays() -> None:
    numerator = MODE.sum() * np.array([0.3, 0.7])
    a, b = MODE, numerator
    for frequency, share in ((2.0, 0.02), (60.0, 0.01)):
        left, right = relaxation(frequency, share)
        a, b = np.convolve(a, left), np.convolve(b, right)
    lean = quick_dynamics(stage(a, b), 1e-3)["arx"]
    assert isinstance(lean, Arx)
    assert lean.array("a").size == a.size - 1
    assert lean.array("b").size == b.size
    assert lean.group_delay < 20.0 < stage(a, b)["arx"].group_delay  # type: ignore[attr-defined]
    plain = stage(MODE, numerator)["arx"]
    assert isinstance(plain, Arx)
    np.testing.assert_allclose(lean.response(FREQUENCIES, PERIOD), plain.response(FREQUENCIES, PERIOD), rtol=1e-6)


@pytest.mark.parametrize(("frequency", "share"), [(10.0, 0.9), (1000.0, 0.02)])
def test_a_slow_amplifier_and_a_quick_relaxation_stay(frequency: float, share: float) -> None:
    left, right = relaxation(frequency, share)
    model = stage(np.convolve(MODE, left), np.convolve([MODE.sum()], right))
    assert quick_dynamics(model, 1e-3) is model


def test_a_model_without_dynamics_is_returned_unchanged() -> None:
    model = Model((BoucWen(),), PERIOD, 10.0, 1e-5)
    assert quick_dynamics(model, 1e-3) is model
