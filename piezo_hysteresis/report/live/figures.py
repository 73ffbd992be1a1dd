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

"""The four figures of the page: Bokeh figures of loop, displacement, residual and its spectrum."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, Legend, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from ..density import density
from ..palette import BLACK, BLUE, ORANGE
from .points import LINE_POINTS, extremes, followed, loop_places, newest_cycles, padded, with_gaps
from .sample_window import Window

Array = NDArray[np.float64]

HEIGHT = 300
"""Height of a figure [px]."""

SPECTRUM_SAMPLES = 1 << 16
"""Number of newest samples in the spectrum."""

_FEWEST = 64
"""Fewest samples for a spectrum."""

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
"""Tools beside a figure."""

MEASURED: dict[str, Any] = {"color": BLACK, "line_width": 1.4, "legend_label": "measured"}
"""Line of what was measured."""
PREDICTED: dict[str, Any] = {
    "color": ORANGE,
    "line_width": 1.6,
    "line_dash": [6, 3],
    "legend_label": "predicted",
}
"""Line of what the model predicts."""
FLOOR: dict[str, Any] = {
    "color": BLACK,
    "line_width": 1.6,
    "line_dash": [8, 3, 2, 3],
    "legend_label": "sensor noise",
}
"""Line of the noise floor."""
PROMISED: dict[str, Any] = {"color": BLUE, "line_width": 1.4, "line_dash": [2, 3], "legend_label": "model error"}
"""Line of the free-run error that the model file states."""


LINES = (
    *(f"{name}{end}" for name in ("measured", "predicted", "residual") for end in ("_time", "")),
    *("voltage", "loop_measured", "loop_predicted"),
)
"""Columns of the lines over voltage and time; they reach the browser in one message, so that they always agree."""


class WindowFigures:
    """Draws a window of samples in the range of the time axes.

    Parameters
    ----------
    time_label : str
        Label of the time axes.

    Attributes
    ----------
    loop, displacement, residual, spectrum : bokeh figure
        In this order on the page.
    """

    def __init__(self, time_label: str = "time before now [s]") -> None:
        self._time = Range1d(0.0, 1.0, bounds=None)
        self._lines = ColumnDataSource({name: [] for name in LINES}, name="lines_data")
        self._limits = ColumnDataSource({"time": [], "noise": [], "minus_noise": [], "error": [], "minus_error": []})
        self._spectrum = ColumnDataSource({"frequency": [], "residual": []}, name="spectrum_data")
        self._moved = ColumnDataSource({"frequency": [], "displacement": []})
        self._white = ColumnDataSource({"frequency": [], "noise": []})
        self.loop = _figure("loop", "Hysteresis loop", "drive voltage [V]", "displacement [µm]")
        self.loop.line("voltage", "loop_measured", source=self._lines, **MEASURED)
        self.loop.line("voltage", "loop_predicted", source=self._lines, **PREDICTED)
        over_time = {"x_range": self._time}
        self.displacement = _figure("displacement", "Displacement", time_label, "displacement [µm]", **over_time)
        self.displacement.line("measured_time", "measured", source=self._lines, **MEASURED)
        self.displacement.line("predicted_time", "predicted", source=self._lines, **PREDICTED)
        self.residual = _figure(
            "residual", "Residual: measured minus predicted", time_label, "residual [nm]", **over_time
        )
        self.residual.line("residual_time", "residual", source=self._lines, color=ORANGE, legend_label="residual")
        for name, style in (("noise", FLOOR), ("error", PROMISED)):
            self.residual.line("time", name, source=self._limits, **style)
            self.residual.line("time", f"minus_{name}", source=self._limits, **style)
        self.spectrum = _figure(
            "spectrum",
            "Spectrum of the residual",
            "frequency [Hz]",
            "amplitude density [nm/√Hz]",
            x_axis_type="log",
            y_axis_type="log",
        )
        self.spectrum.line("frequency", "displacement", source=self._moved, color=BLACK, legend_label="displacement")
        self.spectrum.line("frequency", "residual", source=self._spectrum, color=ORANGE, legend_label="residual")
        self.spectrum.line("frequency", "noise", source=self._white, **FLOOR)
        for drawn in self.all:
            _legend_above(drawn)

    @property
    def all(self) -> tuple[figure, ...]:
        """The figures, in the order of the page."""
        return self.loop, self.displacement, self.residual, self.spectrum

    @property
    def shown(self) -> tuple[float, float]:
        """Part of the time axis that is shown [s]."""
        return float(self._time.start), float(self._time.end)

    def span(self, start: float, end: float) -> None:
        """Show a part of the time axis [s]; a reset returns to it."""
        self._time.update(start=start, end=end, reset_start=start, reset_end=end)

    def draw(self, window: Window, origin: float, noise: float | None, error: float | None) -> None:
        """Draw loop, displacement and residual of the part of a window that the time axes show.

        Parameters
        ----------
        window : Window
            Samples.
        origin : float
            Time that is zero on the time axes [s].
        noise : float or None
            RMS noise of the sensor [m], where it is known.
        error : float or None
            RMS error that the model states [m], where it does.
        """
        part = _between(window, *(origin + edge for edge in self.shown))
        time, residual = part.time - origin, part.residual
        narrowest = (self.shown[1] - self.shown[0]) / LINE_POINTS  # that can be seen
        followed_at_once = followed(part.time, max(narrowest, 1.5 * window.sample_period))
        lines: dict[str, Array] = {}
        for name, values, scale in (
            ("measured", part.displacement, 1e6),
            ("predicted", part.prediction, 1e6),
            ("residual", residual, 1e9),
        ):
            at, drawn = with_gaps(extremes(values), np.isfinite(values) & followed_at_once, time, values)
            lines |= {f"{name}_time": at, name: scale * drawn}
        cycles = newest_cycles(part)
        u, y, p = with_gaps(
            loop_places(cycles),
            np.isfinite(cycles.displacement),
            cycles.voltage,
            cycles.displacement,
            cycles.prediction,
        )
        lines |= {"voltage": u, "loop_measured": 1e6 * y, "loop_predicted": 1e6 * p}
        self._lines.data = padded(lines)
        self._draw_limits(noise, error)

    def _draw_limits(self, noise: float | None, error: float | None) -> None:
        n, e = (np.nan if value is None else 1e9 * value for value in (noise, error))
        self._limits.data = {
            "time": list(self.shown),
            "noise": [n, n],
            "minus_noise": [-n, -n],
            "error": [e, e],
            "minus_error": [-e, -e],
        }
        for item, value in zip(self.residual.legend[0].items, (0.0, n, e), strict=True):
            item.visible = bool(np.isfinite(value))

    def draw_spectrum(self, window: Window, noise: float | None) -> None:
        """Draw the spectrum of the newest samples of a window; parameters as for `draw`."""
        part = window.part(max(0, window.size - SPECTRUM_SAMPLES))
        for source, name, values in (
            (self._spectrum, "residual", part.residual),
            (self._moved, "displacement", part.displacement),
        ):
            values = _newest_finite(values)
            if values.size < _FEWEST:
                source.data = {"frequency": [], name: []}
                continue
            frequency, height = density([values], window.sample_period)
            source.data = {"frequency": frequency, name: 1e9 * height}
        across = [] if noise is None else [1e9 * noise * np.sqrt(2.0 * window.sample_period)] * 2
        ends = self._moved.data["frequency"]
        self._white.data = {
            "frequency": [ends[0], ends[-1]] if across and len(ends) else [],
            "noise": across if len(ends) else [],
        }


def time_figure(name: str, title: str, label: str) -> figure:
    """An empty figure over dates, in the style of the page."""
    return _figure(name, title, label, "", x_axis_type="datetime")


def _between(window: Window, start: float, end: float) -> Window:
    inside = np.flatnonzero((window.time >= start) & (window.time <= end))
    return window.part(int(inside[0]), int(inside[-1]) + 1) if inside.size else window.part(0, 0)


def _newest_finite(values: Array) -> Array:
    """The samples after the last missing one, or after the one before where too few are left."""
    missing = np.flatnonzero(~np.isfinite(values))
    edges = np.concatenate(([-1], missing, [values.size]))
    lengths = np.diff(edges) - 1
    enough = np.flatnonzero(lengths >= min(_FEWEST, int(lengths.max())))
    k = int(enough[-1])
    return values[edges[k] + 1 : edges[k + 1]]


def _figure(name: str, title: str, x_label: str, y_label: str, **options: Any) -> figure:
    made = figure(
        name=name,
        title=title,
        x_axis_label=x_label,
        y_axis_label=y_label,
        height=HEIGHT,
        sizing_mode="stretch_width",
        tools=TOOLS,
        **options,
    )
    made.toolbar.logo = None
    made.toolbar.autohide = True
    made.grid.grid_line_color = "#e4e4e4"
    made.outline_line_color = None
    return made


def _legend_above(drawn: figure) -> None:
    legend = drawn.legend[0]
    drawn.center = [part for part in drawn.center if not isinstance(part, Legend)]
    legend.update(orientation="horizontal", border_line_color=None, padding=0, margin=2, click_policy="hide")
    legend.label_text_font_size = "12px"
    drawn.add_layout(legend, "above")
