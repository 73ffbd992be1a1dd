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

"""Every kind of phase against time: measurement and prediction, and the residual below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.signal import find_peaks

from ...identification.free_run_error import drive_frequency
from ...record import Record
from ..palette import BLUE
from .comparison import ModelComparison
from .drawing import Drawing
from .style import BEFORE, FLOOR, MEASURED, PREDICTED, RESIDUAL, canvas, handles_of, legend_above, styled
from .thinning import thinned

Array = NDArray[np.float64]

COLUMNS = 3
"""Number of panels in a row."""
PANELS = 12
"""Largest number of phases drawn."""
TURNS = 16
"""Largest number of turning points of the drive in one panel."""

BAND = (
    " The band is the 95 % uncertainty of the prediction from the parameters. A residual outside the band by more than "
    "the noise shows an effect that the model does not contain."
)
"""Sentence of the caption if a prediction band is drawn."""


def window(record: Record, residual: Array | None) -> slice:
    """The part of a record to draw.

    The whole record, or as many turning points of the drive as can be distinguished, around the largest residual in the
    middle half of the record, without the ramps from and to rest.
    """
    quarter = record.size // 4
    middle = slice(quarter, record.size - quarter)
    drive = record.voltage[middle]
    tops = find_peaks(drive, prominence=0.02 * (float(np.ptp(drive)) or 1.0))[0].size
    if 2 * tops <= TURNS:
        return slice(0, record.size)
    length = max(64, drive.size * TURNS // (2 * tops))
    centre = quarter + (drive.size // 2 if residual is None else int(np.argmax(np.abs(residual[middle]))))
    start = int(np.clip(centre - length // 2, 0, max(0, record.size - length)))
    return slice(start, min(record.size, start + length))


@styled
def time_series(comparison: ModelComparison) -> Drawing:
    """One panel per phase name: displacement above, residual below; fast phases around their largest residual."""
    first: dict[str, int] = {}
    for index in comparison.drawn():
        record = comparison.experiment[index]
        if record.phase not in first or _rms(comparison, index) > _rms(comparison, first[record.phase]):
            first[record.phase] = index
    sines = sorted((f, r.phase) for r in comparison.experiment if (f := drive_frequency(r)) is not None)
    ends = {sines[0][1], sines[-1][1]} if sines else set()
    between = {phase for _, phase in sines} - ends
    shown = sorted(index for phase, index in first.items() if phase not in between)
    if len(shown) > PANELS:
        shown = sorted(sorted(shown, key=lambda i: -_rms(comparison, i))[:PANELS])
    now, before = comparison.now, comparison.before
    columns, bands = min(COLUMNS, len(shown)), -(-len(shown) // COLUMNS)
    heights = [2.0, 1.0] * bands if now is not None else [1.0] * bands
    figure, axes = canvas(
        len(heights), columns, (2.9 if now is not None else 1.9) * bands + 0.3, gridspec_kw={"height_ratios": heights}
    )
    step = len(heights) // bands
    data: dict[str, NDArray[Any]] = {}
    for place, index in enumerate(shown):
        record = comparison.experiment[index]
        row, column = step * (place // columns), place % columns
        part = window(record, None if now is None else now.residuals[index])
        time = record.sample_period * np.arange(record.size)[part]
        scale, unit = (1e3, "ms") if time[-1] < 2.0 else (1.0, "s")
        y = record.displacement[part]
        at = thinned(y, 500)
        upper = axes[row, column]
        upper.plot(scale * time[at], 1e6 * y[at], label="measured", **MEASURED)
        data |= {f"time_s_{record.phase}": time[at], f"measured_m_{record.phase}": y[at]}
        upper.set_title(record.phase)
        bottom = upper
        if now is not None:
            predicted = now.predicted[index][part]
            upper.plot(scale * time[at], 1e6 * predicted[at], label="predicted", **PREDICTED)
            bottom = axes[row + 1, column]
            upper.tick_params(labelbottom=False)
            if before is not None:
                old = before.residuals[index][part]
                old_at = thinned(old, 700)
                bottom.plot(
                    scale * time[old_at], 1e9 * old[old_at], label="residual before", **{**BEFORE, "linewidth": 0.9}
                )
            e = now.residuals[index][part]
            e_at = thinned(e, 700)
            bottom.plot(scale * time[e_at], 1e9 * e[e_at], label="residual", **RESIDUAL)
            if comparison.bands is not None:
                half = 1e9 * comparison.bands[index][part]
                bottom.fill_between(
                    scale * time[at],
                    -half[at],
                    half[at],
                    color=BLUE,
                    alpha=0.35,
                    zorder=3,
                    label="95 % of the prediction",
                )
                data[f"prediction_95_m_{record.phase}"] = 1e-9 * half[at]
            for sign in (-2.0, 2.0):
                bottom.axhline(sign * 1e9 * comparison.floors[index], **FLOOR)
            data |= {f"predicted_m_{record.phase}": predicted[at], f"residual_time_s_{record.phase}": time[e_at]}
            data[f"residual_m_{record.phase}"] = e[e_at]
        for axis in {upper, bottom}:  # labels of a late window are long
            axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        bottom.set_xlabel(f"time in phase [{unit}]")
        if column == 0:
            upper.set_ylabel("y [µm]")
            if now is not None:
                bottom.set_ylabel("residual [nm]")
    for place in range(len(shown), bands * columns):
        for extra in range(step):
            axes[step * (place // columns) + extra, place % columns].set_axis_off()
    handles = handles_of(axes[0, 0])
    if now is not None:
        handles |= handles_of(axes[1, 0])
        handles["± 2 × floor"] = axes[1, 0].get_lines()[-1]
    legend_above(figure, handles, columns=len(handles))
    figure.align_ylabels()
    names = ", ".join(comparison.experiment[i].phase for i in shown)
    words = "no model was given" if now is None else f"largest residual {1e9 * now.largest:.3g} nm"
    return Drawing(
        "time_series",
        "Against time",
        (
            "Displacement. Of repeated phases, one is shown; of the sines, the slowest and the fastest."
            if now is None
            else "Displacement, and below it the residual (measured minus predicted). Fast phases are shown "
            "around their largest residual. A phase that begins in an unknown state is not shown. Of "
            "repeated phases, the one with the largest error is shown; of the sines, the slowest and the fastest."
            + ("" if comparison.bands is None else BAND)
        ),
        f"Displacement against time for the phases {names}; {words}.",
        figure,
        data,
    )


def _rms(comparison: ModelComparison, index: int) -> float:
    return 0.0 if comparison.now is None else comparison.now.rows[index].rms
