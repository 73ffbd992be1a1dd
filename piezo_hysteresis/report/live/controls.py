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

"""`Controls`: the buttons of an axis. All but the stop describe the action and ask before they act."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from html import escape

from bokeh.models import Button, Column, Div, InlineStyleSheet, Row

from .source import Answer, LiveSource


@dataclass(frozen=True, slots=True)
class Control:
    """One button.

    Parameters
    ----------
    name : str
        Label of the button.
    service : str
        Service that it calls, relative to the axis.
    question : str
        Question that is shown before the call; empty where the button acts at once.
    plan : str
        Service whose answer is shown with the question, and has to be positive.
    kind : str
        Style of the button.
    """

    name: str
    service: str
    question: str = ""
    plan: str = ""
    kind: str = "default"


CONTROLS: tuple[Control, ...] = (
    Control("Stop", "driver_node/stop", kind="danger"),
    Control("Release", "driver_node/release", "Ends the stop. Commands and set-points can move the stage again."),
    Control(
        "Identify",
        "identification_node/identify",
        "Moves the stage, records it, and fits a model. The new model replaces the present one.",
        plan="identification_node/plan",
        kind="primary",
    ),
    Control(
        "Diagnose",
        "identification_node/diagnose",
        "Looks for the effect that the model is missing in the last recording. With the parameter live of the "
        "identification node it moves the stage and records instead. If an effect is found, the extended model "
        "replaces the present one.",
        kind="primary",
    ),
    Control(
        "Abort",
        "identification_node/abort",
        "Ends the identification or diagnosis under way. The stage goes to its safe voltage, and the recording "
        "remains readable.",
    ),
    Control(
        "Take baseline",
        "model_node/baseline",
        "Takes the present state of the stage as good. The change watch then compares with it. Drive the stage as in "
        "normal use meanwhile.",
    ),
    Control(
        "Recalibrate",
        "model_node/recalibrate",
        "Fits the few numbers of the group that has changed to the last minute, and replaces the model.",
        plan="model_node/plan_recalibration",
    ),
)
"""The buttons of an axis, in the order of the page."""


class Controls:
    """Buttons, a question, and the answer of the last call.

    Parameters
    ----------
    source : LiveSource
        Source of the services.
    axis : callable
        Name of the axis that is shown.
    styles : bokeh InlineStyleSheet
        Of texts.
    """

    def __init__(self, source: LiveSource, axis: Callable[[], str], styles: InlineStyleSheet) -> None:
        self._source, self._axis = source, axis
        self._pending: list[tuple[Future[Answer], Callable[[Answer], None]]] = []
        self._asked: tuple[Control, str, str] | None = None
        self._number = 0  # of the question; an answer to an earlier one has no effect
        self._answer = Div(text="", name="answer", stylesheets=[styles], sizing_mode="stretch_width", visible=False)
        self._question = Div(text="", name="question", stylesheets=[styles], sizing_mode="stretch_width")
        self._confirm = Button(label="Confirm", name="confirm", button_type="warning", width=150)
        self._cancel = Button(label="Do not", name="cancel", width=110)
        self._confirm.on_click(self._confirmed)
        self._cancel.on_click(self._close)
        self._panel = Column(
            self._question, Row(self._confirm, self._cancel), visible=False, sizing_mode="stretch_width"
        )
        self.buttons = {control.name: self._button(control) for control in CONTROLS}
        stop, *others = self.buttons.values()
        self.stop = stop
        self.layout = Column(
            Row(*others, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"}),
            self._panel,
            self._answer,
            name="controls",
            sizing_mode="stretch_width",
        )

    def _button(self, control: Control) -> Button:
        label = f"{control.name} …" if control.question else control.name
        button = Button(label=label, name=control.name.lower().replace(" ", "_"), button_type=control.kind, width=125)
        button.on_click(lambda: self._pressed(control))
        return button

    def poll(self) -> None:
        """Show new answers."""
        done = [pending for pending in self._pending if pending[0].done()]
        self._pending = [pending for pending in self._pending if not pending[0].done()]
        for future, then in done:
            then(future.result())

    def close(self) -> None:
        """Remove the question, e.g. because another axis is shown."""
        self._close()
        self._answer.visible = False

    def _call(self, axis: str, service: str, then: Callable[[Answer], None]) -> None:
        self._pending.append((self._source.call(axis, service), then))

    def _pressed(self, control: Control) -> None:
        self._close()
        axis = self._axis()
        if not control.question:
            self._act(control, axis)
        elif control.plan:
            self._show(f"<p>{escape(control.name)}: asking for the plan …</p>", ready=False)
            self._plan(control, axis, lambda answer: self._planned(control, axis, answer))
        else:
            self._ask(control, axis, "")

    def _plan(self, control: Control, axis: str, then: Callable[[Answer], None]) -> None:
        """Ask for a plan, whose answer counts only if the question is still the same."""
        number = self._number
        self._call(axis, control.plan, lambda answer: then(answer) if number == self._number else None)

    def _planned(self, control: Control, axis: str, answer: Answer, note: str = "") -> None:
        if answer.success:
            self._ask(control, axis, answer.message, note)
        else:
            self._close()
            self._report(control, axis, Answer(False, f"no plan: {answer.message}"))

    def _ask(self, control: Control, axis: str, plan: str, note: str = "") -> None:
        self._asked = (control, axis, plan)
        shown = f"<p class='plan'><b>Plan</b> {escape(plan)}</p>" if plan else ""
        self._show(
            f"{note}<p><b>{escape(control.name)} {escape(axis)}?</b> {escape(control.question)}</p>{shown}", ready=True
        )
        self._confirm.label = control.name

    def _confirmed(self) -> None:
        if self._asked is None:
            return
        (control, axis, plan), self._asked = self._asked, None
        if not control.plan:
            self._close()
            self._act(control, axis)
            return
        self._confirm.disabled = True

        def compare(answer: Answer) -> None:
            """Compare the plan with the confirmed one before the call."""
            if answer == Answer(True, plan):
                self._close()
                self._act(control, axis)
            else:
                self._planned(control, axis, answer, "<p><b>The plan has changed meanwhile.</b></p>")

        self._plan(control, axis, compare)

    def _act(self, control: Control, axis: str) -> None:
        self._answer.update(text=f"<p>{escape(control.name)} {escape(axis)}: sent …</p>", visible=True)
        self._call(axis, control.service, lambda answer: self._report(control, axis, answer))

    def _report(self, control: Control, axis: str, answer: Answer) -> None:
        word = "ok" if answer.success else "error"
        text = (
            f"<p id='answer'><span class='badge {word}'>{'done' if answer.success else 'refused'}</span> "
            f"{escape(control.name)} {escape(axis)}: {escape(answer.message)}</p>"
        )
        self._answer.update(text=text, visible=True)

    def _show(self, text: str, *, ready: bool) -> None:
        self._question.text = f"<div id='question'>{text}</div>"
        self._confirm.disabled = not ready
        self._panel.visible = True

    def _close(self) -> None:
        self._asked = None
        self._number += 1
        self._panel.visible = False
