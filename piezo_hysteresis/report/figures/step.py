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

"""The averaged step response with the delay, near its onset and complete."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from ...effects import Arx
from ...errors import IdentificationError
from ...identification.steps.delay import identify_delay
from ...identification.steps.step_response import StepResponse, step_response
from ..palette import BLUE, GREEN
from ..words import duration
from .comparison import ModelComparison
from .drawing import Drawing
from .style import MEASURED, PREDICTED, canvas, styled

ZOOM = 24
"""Number of samples drawn around the onset."""


@styled
def step(comparison: ModelComparison) -> Drawing | None:
    """Response per volt to the fastest edges of the experiment, averaged, ± 2σ of the noise."""
    members = comparison.indices("step", "steps") or list(range(len(comparison.experiment)))
    period = min(comparison.experiment[i].sample_period for i in members)
    members = [i for i in members if comparison.experiment[i].sample_period < 1.001 * period]
    records = [comparison.experiment[i] for i in members]
    try:
        measured = step_response(records)
        delay = identify_delay(records)
    except IdentificationError:
        return None
    predicted = None
    if comparison.now is not None:
        answers = [comparison.now.predicted[i] for i in members]
        predicted = step_response([replace(r, displacement=y) for r, y in zip(records, answers, strict=True)])
    figure, (axes,) = canvas(1, 2, 3.4)
    scale = _draw(axes[0], measured, predicted, min(measured.mean.size, max(ZOOM, delay.samples + 8)))
    _draw(axes[1], measured, predicted, measured.mean.size)
    label = f"delay {delay.samples} sample{'' if delay.samples == 1 else 's'}"
    axes[0].axvline(scale * delay.time, color=BLUE, linestyle=(0, (6, 2, 1, 2)), label=label)
    model = comparison.model
    if model is not None and Arx.name in model:
        lag = model[Arx.name]["delay"] * model.sample_period
        axes[0].axvline(scale * lag, color=GREEN, linestyle=(0, (1, 1.4)), label=f"delay of the model {duration(lag)}")
    axes[0].set_title("onset")
    axes[1].set_title("whole response")
    axes[1].set_xscale("log")
    axes[0].set_ylabel("displacement per volt [µm/V]")
    axes[0].legend(loc="lower right")
    data = {
        "time_s": measured.sample_period * np.arange(measured.mean.size),
        "measured_m_per_V": measured.mean,
        "deviation_m_per_V": measured.deviation,
    }
    if predicted is not None:
        data["predicted_m_per_V"] = predicted.mean
    message = "; ".join(n.message for n in delay.notices)
    return Drawing(
        "step",
        "Step and delay",
        (
            f"Mean of {measured.edges} edges, ± 2σ; {delay}. The delay is read from the first sample "
            "that exceeds the noise, not from a fit."
        )
        + (f" Note: {message}." if message else ""),
        f"Step response: {delay}; it reaches {1e6 * measured.mean[-1]:.4g} µm/V after {duration(data['time_s'][-1])}.",
        figure,
        data,
    )


def _draw(axis: Axes, measured: StepResponse, predicted: StepResponse | None, end: int) -> float:
    """Draw a response and return the unit of its time axis [1/s]."""
    time = 1e6 * measured.sample_period * np.arange(end)
    scale, unit = (1e-3, "ms") if time[-1] > 1e3 else (1.0, "µs")
    style = {**MEASURED, "marker": "o" if end < 64 else "", "markersize": 3}
    mean, bars = 1e6 * measured.mean[:end], 2e6 * measured.deviation[:end]
    axis.errorbar(scale * time, mean, bars, label="measured ± 2σ", elinewidth=0.8, **style)
    if predicted is not None:
        upto = min(end, predicted.mean.size)
        axis.plot(scale * time[:upto], 1e6 * predicted.mean[:upto], label="predicted", zorder=3, **PREDICTED)
    axis.set_xlabel(f"time since the edge [{unit}]")
    return 1e6 * scale
