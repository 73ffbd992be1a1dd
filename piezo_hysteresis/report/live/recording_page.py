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

"""`RecordingPage`: one view of a recording in one browser window, with zoom into every sample."""

from __future__ import annotations

import numpy as np
from bokeh.document import Document
from bokeh.models import Select

from ...errors import counted
from ..figures.comparison import ModelComparison
from ..words import duration
from . import recording_panels
from .figures import WindowFigures
from .layout import Section, lay_out, panel_styles, text_panel
from .sample_window import Window


class RecordingPage:
    """Draws one phase of an experiment; what is shown follows the zoom of the time axes.

    Parameters
    ----------
    document : bokeh Document
        Of one browser window.
    comparison : ModelComparison
        The experiment, and its comparison with a model, if there is one.
    title : str
        Heading of the page.
    """

    def __init__(self, document: Document, comparison: ModelComparison, title: str) -> None:
        self._comparison = comparison
        names = [f"{k} {record.phase}" for k, record in enumerate(comparison.experiment, 1)]
        self._phase = Select(name="phase", title="", options=names, value=names[0], width=180)
        self._phase.on_change("value", lambda attribute, old, new: self._chosen())
        self._figures = WindowFigures("time since the beginning of the phase [s]")
        styles = panel_styles()
        self._state, self._records = text_panel("state", styles), text_panel("records", styles)
        self._records.text = recording_panels.records(comparison)
        self._chosen()
        figures = self._figures
        lay_out(
            document,
            title,
            (self._phase,),
            (
                Section(self._state),
                *(Section(drawn, classes="half figure") for drawn in figures.all),
                Section(self._records, "Phases"),
            ),
            self._tick,
        )

    def _chosen(self) -> None:
        index = self._phase.options.index(self._phase.value)
        record, now = self._comparison.experiment[index], self._comparison.now
        predicted = np.full(record.size, np.nan) if now is None else now.predicted[index]
        time = record.sample_period * np.arange(record.size, dtype=np.float64)
        self._window = Window(time, record.voltage, record.displacement, predicted, record.sample_period)
        self._noise = float(self._comparison.noise[index])
        self._figures.span(0.0, float(time[-1]) or record.sample_period)
        self._figures.draw_spectrum(self._window, self._noise)
        self._drawn: tuple[float, float] | None = None
        words = f"{counted(record.size, 'sample')} every {duration(record.sample_period)}, {duration(record.duration)}"
        self._state.text = recording_panels.record(self._comparison, index, words)
        self._tick()

    def _tick(self) -> None:
        if self._figures.shown != self._drawn:
            self._drawn = self._figures.shown
            self._figures.draw(self._window, 0.0, self._noise, None)
