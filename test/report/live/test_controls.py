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

"""The buttons of the page: an action that was called off, or another question, is not overtaken by a late plan."""

from __future__ import annotations

from concurrent.futures import Future

import pytest
from bokeh.events import ButtonClick
from bokeh.models import InlineStyleSheet

from piezo_hysteresis.report.live.controls import Controls
from piezo_hysteresis.report.live.source import Answer

IDENTIFY, PLAN = "identification_node/identify", "identification_node/plan"


class Source:
    """Services that answer when a test lets them."""

    def __init__(self) -> None:
        self.called: list[tuple[str, str, Future]] = []

    def call(self, axis, service):
        self.called.append((axis, service, Future()))
        return self.called[-1][2]

    @property
    def services(self):
        return [service for _, service, _ in self.called]


@pytest.fixture
def page():
    """Source, controls, and what is done with the mouse."""
    source = Source()
    return source, Controls(source, lambda: "/stage_x", InlineStyleSheet(css=""))


def press(controls, name):
    button = controls.stop if name == "stop" else controls.buttons.get(name) or getattr(controls, f"_{name}")
    button._trigger_event(ButtonClick(button))


def answer(page, message="17.6 s"):
    source, controls = page
    source.called[-1][2].set_result(Answer(True, message))
    controls.poll()


def test_a_confirmed_plan_that_is_still_the_same_is_carried_out(page):
    source, controls = page
    press(controls, "Identify")
    answer(page)
    press(controls, "confirm")
    answer(page)
    assert source.services == [PLAN, PLAN, IDENTIFY]


def test_an_action_that_is_called_off_while_its_plan_is_compared_is_not_carried_out(page):
    source, controls = page
    press(controls, "Identify")
    answer(page)
    press(controls, "confirm")
    press(controls, "cancel")
    answer(page)
    assert source.services == [PLAN, PLAN]
    assert not controls._panel.visible


def test_a_stop_calls_a_confirmed_action_off(page):
    source, controls = page
    press(controls, "Identify")
    answer(page)
    press(controls, "confirm")
    source.called[-1][2].set_result(Answer(True, "17.6 s"))
    press(controls, "stop")
    controls.poll()
    assert source.services == [PLAN, PLAN, "driver_node/stop"]


def test_a_late_plan_does_not_ask_in_place_of_another_question(page):
    source, controls = page
    press(controls, "Identify")
    press(controls, "Abort")
    answer(page)
    assert "Abort" in controls._question.text
    assert controls._confirm.label == "Abort"
    press(controls, "confirm")
    assert source.services == [PLAN, "identification_node/abort"]


@pytest.mark.parametrize("end", ["cancel", "close"])
def test_a_late_plan_asks_nothing_after_the_question_was_closed(page, end):
    _, controls = page
    press(controls, "Identify")
    press(controls, "cancel") if end == "cancel" else controls.close()
    answer(page)
    assert not controls._panel.visible
