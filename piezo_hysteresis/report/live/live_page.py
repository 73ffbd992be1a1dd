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

"""`LivePage`: one view of a running axis in one browser window."""

from __future__ import annotations

import time
from html import escape

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import CustomJS, Select, Toggle

from ...errors import printable
from ...identification.records.noise_floor import white_noise
from ...record import Record
from . import panels
from .axis_state import AxisState
from .controls import Controls
from .figures import WindowFigures
from .history import NumberHistory
from .layout import Section, lay_out, panel_styles, text_panel
from .sample_window import Window
from .source import LiveSource

TITLE = "Piezo stage, live"
"""Heading of the page."""

SLOW = 1.0
"""Time between two spectra and two estimates of the noise, which need at least as much time [s]."""

WINDOWS = {"1 s": 1.0, "3 s": 3.0, "10 s": 10.0}
"""Lengths of the time axis to choose from [s]."""

_REMEMBER = "history.replaceState(null, '', `?axis=${encodeURIComponent(this.value)}`)"
"""Runs in the browser when an axis is chosen, so that the page shows it again when it is loaded anew."""

_NOISE_SAMPLES = 8192
"""Newest samples from which the noise of the sensor is estimated."""


class LivePage:
    """Draws one axis of a source four times a second.

    Parameters
    ----------
    document : bokeh Document
        Of one browser window.
    source : LiveSource
        Axes and services.
    """

    def __init__(self, document: Document, source: LiveSource) -> None:
        self._document, self._source = document, source
        styles = panel_styles()
        asked = getattr(document.session_context, "request", None)
        wanted = asked.arguments.get("axis", [b""])[0].decode(errors="replace") if asked else ""
        self._axis = Select(name="axis", title="", options=[], value=wanted, width=150)
        self._axis.on_change("value", lambda attribute, old, new: self._chosen())
        self._axis.js_on_change("value", CustomJS(code=_REMEMBER))
        self._length = Select(name="length", title="", options=list(WINDOWS), value="3 s", width=80)
        self._length.on_change("value", lambda attribute, old, new: self._span())
        self._pause = Toggle(name="pause", label="Pause", width=80)
        self._figures = WindowFigures()
        self._history = NumberHistory()
        self._controls = Controls(source, lambda: str(self._axis.value or ""), styles)
        self._texts = {name: text_panel(name, styles) for name in ("state", "alarms", "identification", "model")}
        self._window: Window | None = None
        self._noise: float | None = None
        self._slow = float("-inf")
        self._drawn: tuple[int, tuple[float, float]] | None = None
        self._span()
        figures, texts = self._figures, self._texts
        lay_out(
            document,
            TITLE,
            (self._axis, self._length, self._pause, self._controls.stop),
            (
                Section(texts["state"]),
                Section(self._controls.layout, classes="screen-only"),
                Section(figures.loop, classes="half figure"),
                Section(figures.residual, classes="half figure"),
                Section(figures.displacement, classes="half figure"),
                Section(figures.spectrum, classes="half figure"),
                Section(texts["alarms"], "Alarms", "half"),
                Section(texts["identification"], "Identification", "half"),
                Section(
                    column(texts["model"], self._history.layout, name="models", sizing_mode="stretch_width"), "Model"
                ),
            ),
            self._tick,
        )

    def _span(self) -> None:
        self._figures.span(-WINDOWS[str(self._length.value)], 0.0)

    def _chosen(self) -> None:
        self._controls.close()
        self._window, self._noise, self._slow, self._drawn = None, None, float("-inf"), None

    def _state(self) -> AxisState | None:
        axes = self._source.axes()
        if axes and not self._axis.value:
            self._axis.value = next(iter(axes))
        options = sorted({*axes, self._axis.value} - {""})
        if options != self._axis.options:
            self._axis.options = options
            self._axis.visible = len(options) != 1
        return axes.get(str(self._axis.value))

    def _is_seen(self) -> bool:
        """False as long as no browser window shows the page: before one is connected, and after it was closed."""
        session = getattr(self._document.session_context, "session", None)
        return session is None or session.connection_count > 0

    def _tick(self) -> None:
        if not self._is_seen():
            return
        self._controls.poll()
        axis = self._state()
        if axis is None:
            name = escape(printable(str(self._axis.value))) or "No axis"
            self._texts["state"].text = f"<p>{name} was not found yet: no node publishes its topic 'samples'.</p>"
            return
        if self._pause.active:
            if self._window is None:  # all kept samples, so that they can be examined in detail
                self._window = axis.window.newest(max(WINDOWS.values()))
            window = self._window
        else:
            self._window, window = None, axis.window.newest(max(SLOW, -self._figures.shown[0]))
        self._draw(axis, window)
        self._write(axis)

    def _draw(self, axis: AxisState, window: Window) -> None:
        if window.size == 0:
            return
        is_due = time.monotonic() - self._slow >= SLOW
        if is_due:
            self._slow = time.monotonic()
            self._noise = noise_of(window)
            self._figures.draw_spectrum(window, self._noise)
        drawn = (axis.window.received if not self._pause.active else -1, self._figures.shown)
        if drawn != self._drawn or is_due:
            self._drawn = drawn
            self._figures.draw(window, float(window.time[-1]), self._noise, axis.free_run_error)

    def _write(self, axis: AxisState) -> None:
        self._history.show(axis.recalibrations)
        for name, text in (
            ("state", panels.state(axis, self._noise)),
            ("alarms", panels.alarms(axis)),
            ("identification", panels.identification(axis)),
            ("model", panels.model(axis)),
        ):
            if self._texts[name].text != text:
                self._texts[name].text = text


def noise_of(window: Window) -> float | None:
    """RMS noise of the sensor in the newest samples of a window [m]; None where there are too few."""
    newest = window.part(max(0, window.size - _NOISE_SAMPLES))
    good = np.isfinite(newest.displacement)
    if good.sum() < 64:
        return None
    return white_noise(Record(newest.voltage[good], newest.displacement[good], window.sample_period))
