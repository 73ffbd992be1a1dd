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

"""Spectrum of the residual and of the noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..density import density
from ..words import duration
from .comparison import ModelComparison
from .drawing import Drawing
from .style import BEFORE, FLOOR, MEASURED, PREDICTED, canvas, handles_of, legend_above, styled

Array = NDArray[np.float64]

PANELS = 3
"""Largest number of sample periods drawn."""


@styled
def residual_spectrum(comparison: ModelComparison) -> Drawing | None:
    """Amplitude density of displacement, residual and noise floor, one panel per sample period of the experiment."""
    now, before = comparison.now, comparison.before
    if now is None:
        return None
    groups: dict[float, list[int]] = {}
    for index, record in enumerate(comparison.experiment):
        if record.size >= 64:
            period = next((p for p in groups if abs(p / record.sample_period - 1.0) < 1e-3), record.sample_period)
            groups.setdefault(period, []).append(index)
    if not groups:
        return None
    periods = sorted(sorted(groups, key=lambda p: -sum(comparison.experiment[i].size for i in groups[p]))[:PANELS])
    figure, axes = canvas(1, len(periods), 3.4)
    data: dict[str, Array] = {}
    descriptions = []
    for axis, period in zip(axes.flat, periods, strict=True):
        members = groups[period]
        name = duration(period).replace(" ", "").replace("µ", "u")
        f, moved = density([comparison.experiment[i].displacement for i in members], period)
        _, left = density([now.residuals[i] for i in members], period)
        axis.loglog(f, 1e9 * moved, label="displacement", **MEASURED)
        data |= {f"frequency_Hz_{name}": f, f"displacement_m_per_rtHz_{name}": moved}
        if before is not None:
            _, old = density([before.residuals[i] for i in members], period)
            axis.loglog(f, 1e9 * old, label="residual before", **BEFORE)
            data[f"residual_before_m_per_rtHz_{name}"] = old
        axis.loglog(f, 1e9 * left, label="residual", **PREDICTED)
        floor = float(np.sqrt(2.0 * period * np.mean(comparison.noise[members] ** 2)))
        axis.axhline(1e9 * floor, label="white noise", **FLOOR)
        data |= {f"residual_m_per_rtHz_{name}": left, f"white_noise_m_per_rtHz_{name}": np.array([floor])}
        axis.set_title(f"sampled every {duration(period)}")
        axis.set_xlabel("frequency [Hz]")
        worst = f[int(np.argmax(left / floor))] if floor > 0 else f[int(np.argmax(left))]
        descriptions.append(
            f"at a sample period of {duration(period)} the residual exceeds the noise most at {worst:.3g} Hz"
        )
    axes[0, 0].set_ylabel("amplitude density [nm/√Hz]")
    legend_above(figure, handles_of(axes[0, 0]))
    return Drawing(
        "residual_spectrum",
        "Spectrum of the residual",
        (
            "If the residual lies above the white noise of the sensor, something is missing at that "
            "frequency. Phases of the same sample period are averaged with equal weight."
        ),
        "Spectrum of the residual: " + "; ".join(descriptions) + ".",
        figure,
        data,
    )
