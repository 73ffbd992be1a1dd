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

"""The live residual of the same waveform under each model, one below the other, and the last one enlarged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from bench import Trace
from matplotlib.axes import Axes
from numpy.typing import NDArray

from piezo_hysteresis import Record
from piezo_hysteresis.identification.records.noise_floor import white_noise
from piezo_hysteresis.report.figures.style import FLOOR, SETTINGS, canvas
from piezo_hysteresis.report.palette import BLACK


def save(path: Path, parts: Mapping[str, NDArray], sample_period: float, traces: Mapping[str, Trace]) -> None:
    """Draw the drive and the residual of every model on one scale, the last one enlarged too, and write the file.

    Parameters
    ----------
    path : pathlib.Path
        Of the picture.
    parts : mapping of str to (n,) ndarray
        Name and voltage [V] of every part of the waveform, in order.
    sample_period : float
        Of the waveform [s].
    traces : mapping of str to Trace
        Model to its residual.
    """
    voltage = np.concatenate(list(parts.values()))
    name, last = list(traces.items())[-1]
    floor = white_noise(Record(np.zeros_like(last.residual), last.residual, sample_period))
    with mpl.rc_context(SETTINGS):
        rows = 2 + len(traces)
        figure, axes = canvas(rows, 1, 1.3 * rows + 0.6, sharex=True)
        drive, *residuals, zoom = axes[:, 0]
        every = slice(None, None, max(1, voltage.size // 20_000))
        drive.plot(sample_period * np.arange(voltage.size)[every], voltage[every], color=BLACK, linewidth=0.8)
        drive.set(ylabel="u [V]", ylim=(-0.5, 1.45 * voltage.max()), title="drive, the same for every model")
        _segments(axes[:, 0], parts, sample_period, 1.25 * float(voltage.max()))
        span = 1.05e9 * max(float(np.abs(trace.residual).max()) for trace in traces.values())
        for ax, (label, trace) in zip(residuals, traces.items(), strict=True):
            ax.plot(trace.time[every], trace.residual[every] * 1e9, color=BLACK, linewidth=0.5)
            ax.set(ylabel="residual [nm]", ylim=(-span, span), title=f"{label}: {trace.rms * 1e9:.0f} nm rms")
        zoom.plot(last.time[every], last.residual[every] * 1e9, color=BLACK, linewidth=0.5)
        for sign in (-2e9, 2e9):
            zoom.axhline(sign * floor, **FLOOR)
        limit = 1.05e9 * float(np.abs(last.residual).max())
        title = (
            f"{name}, enlarged {span / limit:.0f} times; lines: ± 2 × noise of the sensor ({1e9 * floor:.0f} nm rms)"
        )
        zoom.set(ylabel="residual [nm]", ylim=(-limit, limit), title=title)
        zoom.set_xlabel("time [s]; residual = measured − predicted: positive where the stage is further than predicted")
        figure.align_ylabels()
        figure.savefig(path)


def _segments(axes: NDArray, parts: Mapping[str, NDArray], sample_period: float, height: float) -> None:
    """Lines between the parts in every panel, and their names above the drive."""
    begin = 0.0
    top: Axes = axes[0]
    for name, voltage in parts.items():
        end = begin + sample_period * voltage.size
        top.text((begin + end) / 2, height, name, ha="center", va="center", fontsize=8.5)
        for ax in axes:
            ax.axvline(end, color="#bbbbbb", linewidth=0.8)
        begin = end
