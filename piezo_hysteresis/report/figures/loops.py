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

"""Hysteresis loops, measured and predicted: one panel per amplitude, one per frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from ...identification.free_run_error import drive_frequency
from ...record import Record
from .comparison import ModelComparison
from .drawing import Drawing
from .style import BEFORE, FLOOR, MEASURED, PREDICTED, RESIDUAL, canvas, handles_of, legend_above, styled
from .thinning import thinned

Array = NDArray[np.float64]

CLOSED = 0.25
"""Largest distance between the ends of a loop, as a share of its height."""
PANELS = 6
"""Largest number of loops in one figure."""
BELOW = " Below: measured minus predicted over the same drive."
"""Words about the residual of a model."""


@dataclass(frozen=True, slots=True)
class Cycle:
    """One rise and fall of the drive in a record, between two samples of equal drive."""

    index: int
    part: slice
    swing: float


def cycles(record: Record, index: int = 0) -> list[Cycle]:
    """Cycles of a drive between its minima; changes below 5 % of its range are ignored.

    Parameters
    ----------
    record : Record
        Record whose drive is cut; the parts before the first and after the last minimum are not cycles.
    index : int
        Index of the record, stored in the cycles.
    """
    u = record.voltage
    span = float(np.ptp(u))
    if span == 0.0:
        return []
    padded = np.concatenate(([u.max() + span], u, [u.max() + span]))
    troughs = find_peaks(-padded, prominence=0.05 * span)[0] - 1
    return [_closed(u, int(a), int(b), index) for a, b in zip(troughs, troughs[1:], strict=False)]


def _closed(u: Array, first: int, last: int, index: int) -> Cycle:
    """The part between two minima that begins and ends at the drive of the higher one."""
    peak = first + int(np.argmax(u[first : last + 1]))
    level = max(u[first], u[last])
    start = first + int(np.flatnonzero(u[first : peak + 1] <= level)[-1])
    stop = peak + int(np.flatnonzero(u[peak : last + 1] <= level)[0]) + 1
    return Cycle(index, slice(start, stop), float(u[peak] - level))


def _closes(record: Record, cycle: Cycle) -> bool:
    """False if the curve is not closed, as in the first cycle of a record with its transient."""
    y = record.displacement[cycle.part]
    return abs(float(y[-1] - y[0])) < CLOSED * float(np.ptp(y))


def opening(voltage: Array, displacement: Array) -> float:
    """Width of a loop at half its height, in % of the height; NaN if a branch has too few samples there."""
    peak = int(np.argmax(voltage))
    middle, height = (voltage.max() + voltage.min()) / 2, float(np.ptp(displacement))
    ways = []
    for u, y in ((voltage[: peak + 1], displacement[: peak + 1]), (voltage[peak:], displacement[peak:])):
        if u.size < 4 or height == 0.0:
            return float("nan")
        order = np.argsort(u, kind="stable")
        ways.append(np.interp(middle, u[order], y[order]))
    return 100.0 * abs(ways[1] - ways[0]) / height


@styled
def loops_by_amplitude(comparison: ModelComparison) -> Drawing | None:
    """Slow loops of up to six swings, from the largest to the smallest."""
    slow = comparison.indices("triangle", "minor")
    sines = [row for row in _sines(comparison) if row[0] <= 10.0]
    slow += [index for _, index in sines[:1]]
    slow = slow or [int(np.argmax([float(np.ptp(r.voltage)) for r in comparison.experiment]))]
    found = [c for i in slow for c in cycles(comparison.experiment[i], i) if _closes(comparison.experiment[i], c)]
    if not found:
        return None
    largest = max(c.swing for c in found)
    groups: list[Cycle] = []
    for cycle in sorted(found, key=lambda c: -c.swing):
        if not groups or groups[-1].swing - cycle.swing > 0.05 * largest:
            groups.append(cycle)
        elif cycle.index < groups[-1].index:
            groups[-1] = cycle
    kept = [groups[i] for i in np.unique(np.linspace(0, len(groups) - 1, PANELS).round().astype(int))]
    titles = [f"{c.swing:.3g} V, {comparison.experiment[c.index].phase}" for c in kept]
    return _drawing(
        comparison,
        kept,
        titles,
        "loops_by_amplitude",
        "Loops by amplitude",
        (
            "Slow loops, one panel per amplitude of the drive. The opening is the width of the loop at half its "
            "height, in % of the height."
            + ("" if comparison.now is None else " The dashed line (model) should cover the solid line (measured).")
            + ("" if comparison.now is None else BELOW)
        ),
    )


@styled
def loops_by_frequency(comparison: ModelComparison) -> Drawing | None:
    """The last cycle of every sine: rate-dependent hysteresis and lag open the loop with frequency."""
    kept, titles = [], []
    for frequency, index in _sines(comparison)[:PANELS]:
        found = cycles(comparison.experiment[index], index)
        full = [c for c in found if c.swing > 0.95 * max(c.swing for c in found)]
        middle = [c for c in full if _steady(comparison.experiment[index], c, frequency)]
        if middle:
            kept.append(middle[-1])
            titles.append(f"{frequency:g} Hz")
    if len(kept) < 2:
        return None
    return _drawing(
        comparison,
        kept,
        titles,
        "loops_by_frequency",
        "Loops by frequency",
        (
            "The last full cycle of every sine. The slowest loop shows the hysteresis. With frequency, "
            "the lag of amplifier, mechanics and sensor opens the loops further."
            + ("" if comparison.now is None else BELOW)
        ),
    )


def _sines(comparison: ModelComparison) -> list[tuple[float, int]]:
    named = ((drive_frequency(r), i) for i, r in enumerate(comparison.experiment))
    return sorted({f: (f, i) for f, i in named if f is not None}.values())


def _steady(record: Record, cycle: Cycle, frequency: float) -> bool:
    length = (cycle.part.stop - cycle.part.start) * record.sample_period
    return abs(length * frequency - 1.0) < 0.1


def _residual_against_drive(axis: Any, u: Array, residual: Array, bound: float) -> None:
    """Residual of both branches of a loop [V, nm], with ± twice the noise floor."""
    peak = int(np.argmax(u))
    for way, word, style in ((slice(0, peak + 1), "rising", RESIDUAL), (slice(peak, u.size), "falling", BEFORE)):
        at = thinned(residual[way], 300)
        axis.plot(u[way][at], residual[way][at], label=f"residual, {word} drive", **{**style, "linewidth": 0.7})
    for sign, name in ((-1.0, "± 2 × floor"), (1.0, "_")):
        axis.axhline(sign * bound, label=name, **FLOOR)


def _drawing(
    comparison: ModelComparison, kept: list[Cycle], titles: list[str], name: str, title: str, caption: str
) -> Drawing:
    columns = min(3, len(kept))
    rows = -(-len(kept) // columns)
    step = 1 if comparison.now is None else 2
    figure, axes = canvas(
        step * rows,
        columns,
        (2.9 if step == 1 else 4.0) * rows + 0.3,
        gridspec_kw={"height_ratios": [2.4, 1.0][:step] * rows},
    )
    data: dict[str, Array] = {}
    descriptions = []
    for panel, (cycle, heading) in enumerate(zip(kept, titles, strict=True), 1):
        row, column = step * ((panel - 1) // columns), (panel - 1) % columns
        axis = bottom = axes[row, column]
        record = comparison.experiment[cycle.index]
        u, y = record.voltage[cycle.part], record.displacement[cycle.part]
        shown = np.union1d(thinned(u, 600), thinned(y, 300))
        axis.plot(u[shown], 1e6 * y[shown], label="measured", **MEASURED)
        words = f"opening {opening(u, y):.1f} %"
        data |= {f"voltage_V_{panel}": u[shown], f"measured_m_{panel}": y[shown]}
        if comparison.now is not None:
            p = comparison.now.predicted[cycle.index][cycle.part]
            axis.plot(u[shown], 1e6 * p[shown], label="predicted", **PREDICTED)
            words += f", predicted {opening(u, p):.1f} %"
            data[f"predicted_m_{panel}"] = p[shown]
            bottom = axes[row + 1, column]
            _residual_against_drive(bottom, u, 1e9 * (y - p), 2e9 * comparison.floors[cycle.index])
            axis.tick_params(labelbottom=False)
        axis.set_title(heading)
        bottom.set_xlabel("drive u [V]")
        axis.text(0.97, 0.04, words.replace(", ", "\n"), transform=axis.transAxes, ha="right", fontsize=8.5)
        descriptions.append(f"{heading}: {words}")
    for number, axis in enumerate(axes[:, 0]):
        axis.set_ylabel("residual [nm]" if number % step else "displacement y [µm]")
    for panel in range(len(kept), rows * columns):
        for extra in range(step):
            axes[step * (panel // columns) + extra, panel % columns].set_axis_off()
    handles = handles_of(axes[0, 0])
    if comparison.now is not None:
        handles |= handles_of(axes[1, 0])
    legend_above(figure, handles, columns=len(handles))
    figure.align_ylabels()
    return Drawing(name, title, caption, f"{title}. " + "; ".join(descriptions) + ".", figure, data)
