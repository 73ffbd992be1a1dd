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

"""The inverse of a sensor's cubic: the root between the turning points, and the nearer of them where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.effects.sensor.sensor_nonlinearity import FAR, cubic_root, turning_points

RANDOM = np.random.default_rng(5)
CASES = [
    (0.0, 0.0),
    (0.3, 0.0),
    (-0.3, 0.0),
    (0.0, -0.2),
    (0.0, 0.2),
    (1.0, -1.0),
    (-0.3, 0.03),
    (3.0**0.5, 1.0),
    (0.01, 1e-9),
]


def reading(x, s2, s3):
    return x + s2 * x**2 + s3 * x**3


def inverse(y, s2, s3):
    x = np.empty_like(y)
    cubic_root(y, s2, s3, *turning_points(s2, s3), x)
    return x


@pytest.mark.parametrize(("s2", "s3"), [*CASES, *RANDOM.uniform(-1.0, 1.0, (30, 2)).tolist()])
def test_a_reading_gives_back_its_position(s2: float, s3: float) -> None:
    low, high = turning_points(s2, s3)
    x = np.concatenate((RANDOM.uniform(max(low, -3.0), min(high, 3.0), 200), [0.0, 1e-30, -1e-30]))
    found = inverse(reading(x, s2, s3), s2, s3)
    np.testing.assert_allclose(reading(found, s2, s3), reading(x, s2, s3), rtol=1e-13, atol=1e-15)
    assert ((found >= low) & (found <= high)).all()


@pytest.mark.parametrize(("s2", "s3"), CASES)
def test_beyond_the_readings_it_is_at_the_turning_point(s2: float, s3: float) -> None:
    for turn in turning_points(s2, s3):
        if abs(turn) < FAR:
            assert 1.0 + 2.0 * s2 * turn + 3.0 * s3 * turn**2 == pytest.approx(0.0, abs=1e-6)
            beyond = reading(turn, s2, s3) * np.array([1.001, 2.0, 100.0])
            np.testing.assert_allclose(inverse(beyond, s2, s3), turn, rtol=1e-9)
