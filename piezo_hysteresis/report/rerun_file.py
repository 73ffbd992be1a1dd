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

"""`write_rerun`: an experiment and the prediction of a model, as a file for the Rerun viewer with a blueprint."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingPackageError
from ..record import Record
from .density import density
from .figures.comparison import ModelComparison
from .figures.thinning import thinned
from .palette import BLACK, BLUE, GREY, ORANGE
from .words import duration, nanometre

Array = NDArray[np.float64]

APPLICATION = "piezo_hysteresis"
"""Name under which the viewer stores the user's layout."""

TIMELINE = "time"
"""Timeline of the file: time since the start of the experiment."""

LOOP_POINTS = 4000
"""Largest number of points of a loop."""

SERIES = {
    "voltage": ("drive voltage [V]", GREY),
    "displacement/measured": ("measured [µm]", BLACK),
    "displacement/predicted": ("predicted [µm]", ORANGE),
    "residual": ("residual [nm]", BLUE),
}
"""Entities over time, with their names and colours."""


def write_rerun(comparison: ModelComparison, path: str | Path, title: str) -> None:
    """Write an .rrd file: every sample, one loop and one spectrum per phase, the phases, and a blueprint of views.

    Parameters
    ----------
    comparison : ModelComparison
        The experiment, and the model if there is one.
    path : str or Path
        The new file.
    title : str
        Name of the recording in the viewer.

    Raises
    ------
    MissingPackageError
        If the package rerun-sdk is not installed.
    """
    try:
        import rerun as rr
    except ImportError:
        raise MissingPackageError("Rerun file", "rerun-sdk", "rerun") from None
    stream: Any = rr.RecordingStream(APPLICATION)
    stream.save(path, default_blueprint=blueprint(comparison))
    stream.send_recording_name(title)
    for name, _ in _series(comparison, 0):
        label, colour = SERIES[name]
        stream.log(name, rr.SeriesLines(names=label, colors=_rgba(colour), widths=1.0), static=True)
    stream.log("notes", rr.TextDocument(_notes(comparison), media_type="text/markdown"), static=True)
    for index, record in enumerate(comparison.experiment):
        stream.set_time(TIMELINE, duration=record.start_time)
        stream.log("phase", rr.StateChange(state=f"{index + 1} {record.phase}"))
        stream.log("phase/text", rr.TextLog(_sentence(comparison, index)))
        for name, values in _series(comparison, index):
            time = rr.TimeColumn(TIMELINE, duration=record.start_time + record.sample_period * np.arange(record.size))
            stream.send_columns(name, [time], rr.Scalars.columns(scalars=values))
        for name, points, colour in _loops(comparison, index):
            stream.log(f"loop/{name}", rr.Points2D(points, colors=_rgba(colour), radii=rr.Radius.ui_points(1.0)))
        for name, frequency, values in _spectra(comparison, index):
            bars = rr.BarChart(values, abscissa=frequency, widths=np.gradient(frequency), color=_rgba(SERIES[name][1]))
            stream.log(f"spectrum/{name}", bars)
    stream.flush()
    stream.disconnect()


def blueprint(comparison: ModelComparison) -> Any:
    """The views: displacement, residual and drive over time, phases, loop, spectrum, and notes."""
    import rerun.blueprint as rrb

    predicted = comparison.now is not None
    loop = "Loop of the phase: displacement over voltage, % of range, measured black"
    over_time = [
        rrb.TimeSeriesView(origin="displacement", name="Displacement [µm]"),
        *([rrb.TimeSeriesView(origin="residual", name="Residual [nm]")] if predicted else []),
        rrb.TimeSeriesView(origin="voltage", name="Drive voltage [V]"),
        rrb.StateTimelineView(contents="phase", name="Phases"),
    ]
    of_phase = [
        rrb.Spatial2DView(
            origin="loop",
            name=loop,
            background=[255, 255, 255],
            visual_bounds=rrb.VisualBounds2D(x_range=[-5.0, 105.0], y_range=[-105.0, 5.0]),
        ),
        rrb.BarChartView(
            origin="spectrum", name=f"{'Residual' if predicted else 'Displacement'}, nm/√Hz over log10(frequency/Hz)"
        ),
        rrb.Tabs(
            rrb.TextDocumentView(origin="notes", name="Recording"), rrb.TextLogView(origin="phase/text", name="Phases")
        ),
    ]
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(*over_time), rrb.Vertical(*of_phase), column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _rgba(colour: str) -> int:
    return int(colour[1:], 16) << 8 | 0xFF


def _predicted(comparison: ModelComparison, index: int) -> Array | None:
    return None if comparison.now is None else comparison.now.predicted[index]


def _series(comparison: ModelComparison, index: int) -> Iterator[tuple[str, Array]]:
    """Entity and values of every sample of a record, in the unit of its name in `SERIES`."""
    record, predicted = comparison.experiment[index], _predicted(comparison, index)
    yield "voltage", record.voltage
    yield "displacement/measured", 1e6 * record.displacement
    if predicted is not None:
        yield "displacement/predicted", 1e6 * predicted
        yield "residual", 1e9 * (record.displacement - predicted)


def _loops(comparison: ModelComparison, index: int) -> Iterator[tuple[str, Array, str]]:
    """Name, points and colour of the loops of a record; y points down in the viewer, and both axes have one scale."""
    record, predicted = comparison.experiment[index], _predicted(comparison, index)
    voltage, displacement = _range(comparison, "voltage"), _range(comparison, "displacement")
    for name, values, colour in (("measured", record.displacement, BLACK), ("predicted", predicted, ORANGE)):
        if values is None:
            continue
        kept = thinned(record.voltage, LOOP_POINTS)
        kept = kept[np.isfinite(values[kept])]
        x = 100.0 * (record.voltage[kept] - voltage[0]) / (voltage[1] - voltage[0])
        y = 100.0 * (values[kept] - displacement[0]) / (displacement[1] - displacement[0])
        yield name, np.column_stack((x, -y)), colour


def _range(comparison: ModelComparison, channel: str) -> tuple[float, float]:
    held = [getattr(record, channel) for record in comparison.experiment]
    low, high = min(float(x.min()) for x in held), max(float(x.max()) for x in held)
    return low, high if high > low else low + 1.0


def _spectra(comparison: ModelComparison, index: int) -> Iterator[tuple[str, Array, Array]]:
    """Name, log10 of the frequency [Hz] and amplitude density [nm/√Hz] of a record."""
    record, predicted = comparison.experiment[index], _predicted(comparison, index)
    name = "displacement/measured" if predicted is None else "residual"
    values = record.displacement if predicted is None else record.displacement - predicted
    values = values[np.isfinite(values)]
    if values.size >= 64:
        frequency, amplitude = density([values], record.sample_period)
        yield name, np.log10(frequency), 1e9 * amplitude


def _sentence(comparison: ModelComparison, index: int) -> str:
    record: Record = comparison.experiment[index]
    error = "" if comparison.now is None else f", residual {nanometre(comparison.now.rows[index].rms)} RMS"
    return f"{index + 1} {record.phase}: {duration(record.duration)}{error}"


def _notes(comparison: ModelComparison) -> str:
    """The phases and the notices of the reader, as Markdown."""
    lines = [f"* {_sentence(comparison, k)}" for k in range(len(comparison.experiment))]
    lines += [f"* **data**: {notice.message}" for notice in comparison.experiment.notices]
    return "\n".join(["Loop and spectrum are those of the phase at the time cursor.", "", *lines, ""])
