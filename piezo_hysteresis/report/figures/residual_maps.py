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

"""The residual against drive, displacement, and rate of the drive."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ...identification.free_run_error import Errors
from ..palette import BLUE, GREY, ORANGE
from .comparison import ModelComparison
from .drawing import Drawing
from .style import canvas, handles_of, legend_above, styled

Array = NDArray[np.float64]

PER_RECORD = 20_000
"""Number of samples of every record, so that all phases have equal weight."""
BINS = 24
"""Number of bins along an axis."""
DECADES = 30.0
"""Smallest ratio of the fastest to the slowest rate for a logarithmic axis."""


@styled
def residual_maps(comparison: ModelComparison) -> Drawing | None:
    """Maps of residual against u, y and du/dt, with the mean of rising and of falling drive."""
    now = comparison.now
    if now is None:
        return None
    u, y, rate, e = (np.concatenate(parts) for parts in zip(*_samples(comparison, now), strict=True))
    limit = float(np.quantile(np.abs(e), 0.9995)) or 1e-12
    figure, axes = canvas(1, 3, 3.4, sharey=True)
    fast = max(float(np.abs(rate).max()), 1e-9)
    moving = np.abs(rate[rate != 0.0])
    slow = 10.0 ** np.ceil(np.log10(max(1e-4 * fast, float(np.quantile(moving, 0.02)) if moving.size else 0.0)))
    data: dict[str, Array] = {}
    descriptions = []
    quantities = (
        ("drive_V", u, "drive u [V]"),
        ("displacement_um", 1e6 * y, "displacement y [µm]"),
        ("rate_V_per_s", rate, "rate du/dt [V/s]"),
    )
    for axis, (name, values, label) in zip(axes.flat, quantities, strict=True):
        if name == "rate_V_per_s" and fast > DECADES * slow:
            axis.set_xscale("symlog", linthresh=slow)
            axis.set_xticks([t for t in (-100 * slow, -slow, slow, 100 * slow) if abs(t) <= fast])
            positive = np.geomspace(slow, max(fast, 2.0 * slow), BINS // 2)
            edges = np.concatenate((-positive[::-1], positive))
        else:
            axis.xaxis.set_major_locator(MaxNLocator(4, prune="both"))  # avoids overlapping labels of neighbouring axes
            edges = np.linspace(values.min(), max(values.max(), values.min() + 1e-9), BINS + 1)
        fine = np.unique(np.concatenate([np.linspace(a, b, 5) for a, b in zip(edges, edges[1:], strict=False)]))
        counts, xs, ys = np.histogram2d(values, e, bins=(fine, np.linspace(-limit, limit, 101)))
        seen = np.where(counts > 0, counts, np.nan).T
        axis.pcolormesh(xs, 1e9 * ys, seen, cmap="Greys", norm=LogNorm(0.3, 20 * counts.max()), rasterized=True)
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        for sign, colour, line, word in ((1, ORANGE, "-", "rising"), (-1, BLUE, (0, (4, 2)), "falling")):
            centre, mean = _means(values, e, edges, np.sign(rate) == sign)
            axis.plot(centre, 1e9 * mean, color=colour, linestyle=line, linewidth=1.8, label=f"mean, drive {word}")
            data |= {f"{name}_{word}": centre, f"residual_m_over_{name}_{word}": mean}
            if mean.size:
                descriptions.append(f"over {name} {word} the mean residual spans {1e9 * np.ptp(mean):.3g} nm")
        axis.set_xlabel(label)
    axes[0, 0].set_ylabel("residual [nm]")
    legend_above(figure, handles_of(axes[0, 0]))
    return Drawing(
        "residual_maps",
        "Residual against drive, displacement and rate",
        (
            "Grey: how often a residual occurs, on a logarithmic scale. All phases have equal weight; "
            "those that begin in an unknown state are left out. "
            "If the mean differs from zero, something is missing in the model. A mean that bends over "
            "u or y is a static nonlinearity. A mean that differs between rising and falling drive is "
            "hysteresis. A mean that grows with du/dt is a lag or a rate dependence."
        ),
        "Maps of the residual: " + "; ".join(descriptions) + ".",
        figure,
        data,
    )


def _samples(comparison: ModelComparison, now: Errors) -> list[tuple[Array, Array, Array, Array]]:
    parts = []
    for index in comparison.drawn():
        record, residual = comparison.experiment[index], now.residuals[index]
        if record.size < 2:
            continue
        step = max(1, record.size // PER_RECORD)
        rate = np.gradient(record.voltage, record.sample_period)
        parts.append((record.voltage[::step], record.displacement[::step], rate[::step], residual[::step]))
    return parts


def _means(values: Array, e: Array, edges: Array, mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Mean of e in every bin with at least 30 samples: mean positions of the samples, and means of e."""
    place = np.clip(np.digitize(values[mask], edges) - 1, 0, edges.size - 2)
    count = np.bincount(place, minlength=edges.size - 1)
    good = count >= 30
    centre = np.bincount(place, values[mask], edges.size - 1)[good] / count[good]
    return centre, np.bincount(place, e[mask], edges.size - 1)[good] / count[good]
