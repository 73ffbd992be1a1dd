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

"""`NumberHistory`: recalibrated numbers of a model over time, with their intervals; one number at a time."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from bokeh.layouts import column
from bokeh.models import ColumnDataSource, Select, Whisker

from ...changes.recalibration_history import RecalibratedNumber
from ..palette import BLUE
from .figures import MEASURED, time_figure

_ONE_DAY = timedelta(days=1)
"""Width of the time axis where there is one point."""


class NumberHistory:
    """A figure, hidden until something was recalibrated, and the choice of the number that it shows.

    Attributes
    ----------
    layout : bokeh Column
        For the page.
    """

    def __init__(self) -> None:
        self._numbers: Sequence[RecalibratedNumber] = ()
        self._choice = Select(name="history_number", title="", options=[], width=240)
        self._choice.on_change("value", lambda attribute, old, new: self._draw())
        self._values = ColumnDataSource({"time": [], "value": [], "low": [], "high": []}, name="history_data")
        self._steps = ColumnDataSource({"time": [], "value": []})
        self._figure = time_figure("history", "Recalibrated number", "time [UTC]")
        self._figure.x_range.default_span = _ONE_DAY
        self._figure.step("time", "value", source=self._steps, mode="after", color=BLUE, line_width=1.4)
        self._figure.scatter("time", "value", source=self._values, size=7, color=MEASURED["color"])
        whisker = Whisker(source=self._values, base="time", upper="high", lower="low", line_color=MEASURED["color"])
        self._figure.add_layout(whisker)
        self.layout = column(
            self._choice, self._figure, name="number_history", sizing_mode="stretch_width", visible=False
        )

    def show(self, numbers: Sequence[RecalibratedNumber]) -> None:
        """Show the history of an axis, the oldest number first. An unchanged history is not drawn again."""
        if numbers is self._numbers:
            return
        self._numbers = numbers
        names = list(dict.fromkeys(n.parameter for n in numbers))
        self._choice.options = names
        self.layout.visible = bool(names)
        if names and self._choice.value not in names:
            self._choice.value = numbers[-1].parameter
        self._draw()

    def _draw(self) -> None:
        rows = [n for n in self._numbers if n.parameter == self._choice.value]
        if not rows:
            return
        time = [1e3 * datetime.fromisoformat(n.time).replace(tzinfo=UTC).timestamp() for n in rows]
        values = [n.new for n in rows]
        self._values.data = {
            "time": time,
            "value": values,
            "low": [n.low for n in rows],
            "high": [n.high for n in rows],
        }
        self._steps.data = {"time": [time[0], *time], "value": [rows[0].old, *values]}
        unit = rows[0].unit
        self._figure.yaxis.axis_label = rows[0].parameter if unit in ("", "1") else f"{rows[0].parameter} [{unit}]"
