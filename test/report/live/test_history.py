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

"""The history of recalibrated numbers on the page: every number over its own times, with its interval."""

from datetime import UTC, datetime

from piezo_hysteresis.changes.recalibration_history import RecalibratedNumber
from piezo_hysteresis.report.live.history import NumberHistory


def number(day, parameter, old, new):
    time = datetime(2026, 3, day, tzinfo=UTC).isoformat()
    return RecalibratedNumber(
        time, "gain", parameter, "m", old, new, 0.9 * new, 1.1 * new, 2.0, 3e-9, 2e-9, 2e-9, 60.0, "a", "b"
    )


def test_one_number_is_drawn_at_a_time_and_the_newest_one_first():
    history = NumberHistory()
    assert not history.layout.visible
    first = (number(1, "displacement_scale", 1e-5, 2e-5), number(2, "extra_delay.tau", 1e-3, 2e-3))
    history.show(first)
    assert history.layout.visible
    choice, figure = history.layout.children
    assert choice.value == "extra_delay.tau"
    choice.value = "displacement_scale"
    history.show((*first, number(3, "displacement_scale", 2e-5, 4e-5)))
    values = figure.select_one({"name": "history_data"})
    assert values.data["value"] == [2e-5, 4e-5]
    assert values.data["low"] == [1.8e-5, 3.6e-5]
    assert values.data["time"][1] - values.data["time"][0] == 2 * 86_400e3
    assert figure.yaxis[0].axis_label == "displacement_scale [m]"


def test_an_axis_without_history_shows_none_of_the_axis_before():
    history = NumberHistory()
    history.show((number(1, "displacement_scale", 1e-5, 2e-5),))
    history.show(())
    assert not history.layout.visible
