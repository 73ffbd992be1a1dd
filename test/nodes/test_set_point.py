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

"""The slow integral behind a displacement that is held: what it settles to, and that it does not wind up."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

from piezo_hysteresis.compensation import Limits
from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.compensation.set_point import SetPoint, volts_per_metre

TICK = 0.1
"""Time between two corrections [s]."""


class Driver:
    """A stage y = gain · u + load behind a publisher of voltages."""

    def __init__(self, gain: float, voltage: float) -> None:
        self.gain, self.load, self.voltages = gain, 0.0, [voltage]

    def publish(self, message) -> None:
        self.voltages.append(message.data)

    def hold(self, point: SetPoint, ticks: int) -> list[float]:
        """Voltages of the next corrections."""
        for _ in range(ticks):
            point.measured(self.gain * self.voltages[-1] + self.load, 100)
            point.tick(TICK)
        return self.voltages[-ticks:]


def held(seed: int) -> tuple[Driver, SetPoint, float]:
    """A displacement that is held inside the limits of 0 and 10 V, its stage, and the voltage that it needs."""
    rng = np.random.default_rng(seed)
    gain, needed = float(rng.uniform(0.5e-6, 5e-6)) * (-1.0) ** seed, float(rng.uniform(2.0, 8.0))
    driver = Driver(gain, 0.0)
    point = SetPoint(driver, float(rng.uniform(0.2, 2.0)))
    point.go(gain * needed, needed + 0.3, 1.0 / gain, Limits(0.0, 10.0))
    return driver, point, needed


@pytest.mark.parametrize("seed", range(6))
def test_a_constant_error_is_removed(seed: int) -> None:
    driver, point, needed = held(seed)
    assert driver.hold(point, 400)[-1] == pytest.approx(needed, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_what_follows_a_time_at_a_limit_does_not_depend_on_its_length(seed: int) -> None:
    after = []
    for ticks in (200, 2000):
        driver, point, needed = held(seed)
        driver.load = -driver.gain * 20.0 * (-1.0) ** (seed // 2)  # no voltage inside the limits is enough
        at_limit = driver.hold(point, ticks)
        assert min(at_limit) >= 0.0 and max(at_limit) <= 10.0 and at_limit[-1] in (0.0, 10.0)
        driver.load = 0.0
        after.append(driver.hold(point, 400))
        assert abs(after[-1][0] - needed) < abs(at_limit[-1] - needed), "it leaves the limit at once"
        assert after[-1][-1] == pytest.approx(needed, abs=1e-6)
    assert after[0] == after[1]


def test_the_integral_waits_until_the_stage_has_arrived() -> None:
    driver = Driver(1e-6, 0.0)
    point = SetPoint(driver, 0.5)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    for _ in range(50):
        point.measured(0.0, 100)
        assert not point.has_left(53.0, TICK), "it is on its way"
        point.tick(TICK)
    assert driver.voltages == [0.0, 5.3]
    assert not point.has_left(0.0, TICK)
    driver.hold(point, 1)
    assert len(driver.voltages) == 3 and abs(driver.voltages[-1] - 5.3) < 0.2


def test_a_stage_that_has_arrived_and_is_elsewhere_was_moved_by_something_else() -> None:
    point = SetPoint(Driver(1e-6, 0.0), 0.5)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    assert not point.has_left(0.5, TICK)
    assert point.has_left(53.0, TICK)


def test_a_stage_that_moves_away_before_it_has_arrived_is_moved_by_something_else() -> None:
    """It may move on for a moment, if it was on its way elsewhere."""
    point = SetPoint(Driver(1e-6, 0.0), 0.5)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    assert not any(point.has_left(distance, TICK) for distance in (20.0, 30.0, 40.0, 30.0, 20.0, 5.0, 3.0))
    assert [point.has_left(distance, TICK) for distance in (10.0, 53.0, 53.0, 53.0, 53.0, 53.0, 53.0)][-1]


@pytest.mark.parametrize("reason", ["missing", "blocked"])
def test_a_hold_ends_with_the_driver(reason) -> None:
    driver = Driver(1e-6, 0.0)
    point = SetPoint(driver, 0.5)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    client = SimpleNamespace(missing="", blocked="", refused_since=lambda since: "", distance=lambda voltage: 0.0)
    lost: list[str] = []
    point.hold(TICK, client, lost.append)
    assert not lost
    setattr(client, reason, "the reason")
    point.hold(TICK, client, lost.append)
    setattr(client, reason, "")
    for _ in range(10):
        point.measured(0.0, 100)
        point.hold(TICK, client, lost.append)
    assert len(lost) == 1 and lost[0].endswith("the reason")
    assert driver.voltages == [0.0, 5.3]


@pytest.mark.parametrize(("distance", "age", "ended"), [(53.0, 0.0, 1), (0.5, 0.0, 0), (53.0, 1.0, 0)])
def test_a_refused_voltage_ends_a_hold_on_its_way_only(distance, age, ended) -> None:
    """Behind the arrival, and before this hold, it was a voltage of another client."""
    refused = [-math.inf]
    client = SimpleNamespace(
        missing="",
        blocked="",
        refused_since=lambda since: "it is playing" if refused[-1] > since else "",
        distance=lambda voltage: distance,
    )
    point = SetPoint(Driver(1e-6, 0.0), 0.5)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    lost: list[str] = []
    point.hold(TICK, client, lost.append)
    refused.append(time.monotonic() - age)
    point.hold(TICK, client, lost.append)
    assert len(lost) == ended


@pytest.mark.parametrize("integral_time", [1e-3, 0.03, 1.0])
def test_no_integral_time_and_no_pause_of_the_samples_makes_the_hold_unstable(integral_time: float) -> None:
    """A correction by more than twice the error makes it larger; an error that was not measured cannot add up."""
    driver = Driver(1e-6, 0.0)
    point = SetPoint(driver, integral_time)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    for _ in range(50):
        point.tick(TICK)  # no samples for 5 s
    assert all(4.7 <= voltage <= 5.3 for voltage in driver.hold(point, 100))
    assert driver.voltages[-1] == pytest.approx(5.0, abs=1e-3)


def test_without_an_integral_time_nothing_is_corrected() -> None:
    driver = Driver(1e-6, 0.0)
    point = SetPoint(driver, 0.0)
    point.go(5e-6, 5.3, 1e6, Limits(0.0, 10.0))
    driver.hold(point, 50)
    assert driver.voltages == [0.0, 5.3]


@pytest.mark.parametrize("p2", [2.2, -2.2])
def test_the_slope_is_that_of_the_model(p2: float) -> None:
    model = Model(
        (BoucWen(A=-0.3 * np.sign(p2), p1=-0.05 * p2, p2=p2), Arx(b=(0.5,)), Offset(y0=1e-6)), 2e-5, 10.0, 1e-5
    )
    ends = [float(model.run(np.full(2000, u), model.rest(u))[0][-1]) for u in (0.0, 10.0)]
    assert volts_per_metre(model, Limits(0.0, 10.0)) == pytest.approx(10.0 / (ends[1] - ends[0]), rel=1e-9)
    assert np.sign(volts_per_metre(model, Limits(0.0, 10.0))) == np.sign(p2)


def test_a_model_that_rests_at_one_displacement_is_refused() -> None:
    with pytest.raises(ModelError, match=r"got 1 µm at rest at 0 V and at 10 V, .* identify again"):
        volts_per_metre(Model((BoucWen(), Arx(b=(0.0,)), Offset(y0=1e-6)), 2e-5, 10.0, 1e-5), Limits(0.0, 10.0))
