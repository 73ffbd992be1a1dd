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

"""Frequency response: measured with its uncertainty, of the model by the same estimator, and of G alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects import Arx
from ...errors import IdentificationError
from ...identification.steps.frequency_response import FrequencyResponse, swept, welch
from ...model.model import Model
from ...record import Record
from ..palette import BLACK, GREEN, SKY
from .comparison import ModelComparison
from .drawing import Drawing
from .style import PREDICTED, canvas, handles_of, legend_above, plain_log, styled

Array = NDArray[np.float64]

POINTS = 48
"""Number of frequencies drawn per level."""
COHERENT = 0.5
"""Smallest coherence of a line that is drawn."""
GAP = 8
"""Number of consecutive incoherent lines after which the drive has no power."""
EDGE = 20
"""Number of lines with which the last one is compared; it is left out if it is three times as uncertain."""
MODEL_LINES = (
    "Dashed: the model, estimated in the same way. Dotted: G alone, times the slope of the loop at a turning point. "
    "At low frequency the measured response differs from this line, because noise of larger amplitude shows more "
    "hysteresis. "
)
"""Words about the lines of a model."""


@styled
def bode(comparison: ModelComparison) -> Drawing | None:
    """Gain and phase from drive to displacement, from the noise phases or other broadband phases."""
    levels = _levels(comparison)
    if not levels:
        return None
    figure, axes = canvas(2, 1, 5.4, sharex=True, gridspec_kw={"height_ratios": [1.3, 1]})
    gain_axis, phase_axis = axes[:, 0]
    data: dict[str, Array] = {}
    descriptions = []
    styles = (("o", BLACK), ("s", SKY))
    for number, (rms, members) in enumerate(levels):
        marker, colour = styles[number]
        found = _response([comparison.experiment[i] for i in members], None)
        if found is None:
            continue
        at = _spread(found)
        f, value, sigma = found.frequency[at], found.value[at], found.deviation[at]
        gain = 1e6 * np.abs(value)
        angle = np.degrees(np.unwrap(np.angle(value)))
        word = f"measured, {rms:.2g} V rms"
        options = {"linestyle": "none", "marker": marker, "color": colour, "markersize": 3.5, "linewidth": 1.0}
        gain_axis.errorbar(f, gain, 2 * gain * sigma, label=f"{word}, ± 2σ", **options)
        phase_axis.errorbar(f, angle, np.degrees(2 * sigma), **options)
        data |= {f"frequency_Hz_{number + 1}": f, f"gain_m_per_V_{number + 1}": np.abs(value)}
        data |= {f"phase_deg_{number + 1}": angle, f"relative_deviation_{number + 1}": sigma}
        descriptions.append(
            f"measured at {rms:.2g} V rms: gain {gain[0]:.3g} µm/V at {f[0]:.3g} Hz, "
            f"phase {angle[-1]:.0f}° at {f[-1]:.4g} Hz"
        )
        if number == 0 and comparison.now is not None:
            answers = [comparison.now.predicted[i] for i in members]
            ours = _response([comparison.experiment[i] for i in members], answers)
            if ours is not None:
                line, turn = np.abs(ours.value[at]), np.degrees(np.unwrap(np.angle(ours.value[at])))
                gain_axis.plot(f, 1e6 * line, label="predicted, same estimator", **PREDICTED)
                phase_axis.plot(f, turn, **PREDICTED)
                data |= {"predicted_gain_m_per_V": line, "predicted_phase_deg": turn}
    if not descriptions:
        return None
    _linear_part(comparison.model, gain_axis, phase_axis, data)
    gain_axis.set_xscale("log")
    gain_axis.set_yscale("log")
    gain_axis.set_ylabel("gain [µm/V]")
    phase_axis.set_ylabel("phase [°]")
    phase_axis.set_xlabel("frequency [Hz]")
    plain_log(gain_axis.xaxis)
    plain_log(gain_axis.yaxis)
    legend_above(figure, handles_of(gain_axis), 2)
    figure.align_ylabels()
    return Drawing(
        "bode",
        "Frequency response",
        (
            "Frequency response from drive to displacement, including hysteresis, averaged over "
            "segments. The bars are ± 2σ. "
            + ("" if comparison.now is None else MODEL_LINES)
            + "If two amplitudes of noise disagree, the stage has hysteresis, backlash or a gain that "
            "depends on amplitude."
        ),
        "Bode diagram. " + "; ".join(descriptions) + ".",
        figure,
        data,
    )


def _levels(comparison: ModelComparison) -> list[tuple[float, list[int]]]:
    """Broadband records of one sample period, grouped by the RMS of their drive; at most two groups, largest first."""
    for phases in (("noise",), ("multisine",), ("chirp",), ("validation",)):
        members = comparison.indices(*phases)
        if members:
            break
    else:
        return []
    period = min(comparison.experiment[i].sample_period for i in members)
    groups: list[tuple[float, list[int]]] = []
    for i in sorted(members, key=lambda i: -float(np.std(_middle(comparison.experiment[i].voltage)))):
        record = comparison.experiment[i]
        rms = float(np.std(_middle(record.voltage)))
        if record.sample_period > 1.001 * period or rms == 0.0:
            continue
        if groups and rms > 0.7 * groups[-1][0]:
            groups[-1][1].append(i)
        else:
            groups.append((rms, [i]))
    return [groups[0], groups[-1]] if len(groups) > 1 else groups


def _middle(samples: Array) -> Array:
    """Samples without the ramps from and to the safe voltage."""
    edge = samples.size // 4
    return samples[edge : samples.size - edge]


def _response(records: Sequence[Record], predicted: Sequence[Array] | None) -> FrequencyResponse | None:
    outputs = [r.displacement for r in records] if predicted is None else predicted
    if records[0].phase.split("_")[0] == "chirp":
        whole = [(r.voltage, y) for r, y in zip(records, outputs, strict=True)]
        try:
            return swept(whole, records[0].sample_period)
        except IdentificationError:
            return None
    signals = [(_middle(r.voltage), _middle(y)) for r, y in zip(records, outputs, strict=True)]
    segment = 1 << int(np.log2(max(16, min(u.size for u, _ in signals) // 4)))
    try:
        return welch(signals, records[0].sample_period, min(segment, 4096))
    except IdentificationError:
        return None


def _spread(found: FrequencyResponse) -> NDArray[np.intp]:
    """Indices of coherent lines, about equally spaced on a logarithmic axis."""
    (good,) = np.nonzero(found.coherence > COHERENT)
    good = good[good > 0] if good.size > 2 else np.arange(1, found.frequency.size)
    # single lines of pure noise can be coherent by chance, so stop at the first wide gap
    (gaps,) = np.nonzero(np.diff(good) > GAP)
    good = good[: gaps[0] + 1] if gaps.size else good
    # single lines at the edge of the band of the drive are not reliable
    while good.size > EDGE and found.deviation[good[-1]] > 3.0 * np.median(found.deviation[good[-EDGE:-1]]):
        good = good[:-1]
    wanted = np.geomspace(found.frequency[good[0]], found.frequency[good[-1]], POINTS)
    nearest = np.abs(np.log(found.frequency[good])[:, None] - np.log(wanted)).argmin(axis=0)
    return np.asarray(good[np.unique(nearest)])


def _linear_part(model: Model | None, gain_axis: object, phase_axis: object, data: dict[str, Array]) -> None:
    if model is None or Arx.name not in model or not model.has_hysteresis:
        return
    g = model.effect(Arx)
    f = np.geomspace(data["frequency_Hz_1"][0], data["frequency_Hz_1"][-1], 200)
    slope = model.hysteresis.turning_slope * model.displacement_scale / model.voltage_scale
    value = slope * g.response(f, model.sample_period)
    angle = np.degrees(np.unwrap(np.angle(value)))
    style = {"color": GREEN, "linestyle": (0, (1, 1.4)), "linewidth": 1.6}
    label = "G alone × slope of the loop at a turning point"
    gain_axis.plot(f, 1e6 * np.abs(value), label=label, **style)  # type: ignore[attr-defined]
    phase_axis.plot(f, angle, **style)  # type: ignore[attr-defined]
    data |= {"G_frequency_Hz": f, "G_gain_m_per_V": np.abs(value), "G_phase_deg": angle}
