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

"""Fig. 5: frequency response measured with noise, beside the ARX model of step 2.

They agree, as in the paper, and both are wrong at low frequency. Noise keeps the Bouc-Wen state near zero, where the
slope of the loop is p2 + A. At low frequency the state relaxes and the slope tends to p2. G contains the difference.
"""

from __future__ import annotations

import numpy as np
import published
from exhibit import DYNAMIC, MEASURED, STATIC, Exhibit, canvas, main
from two_stages import experiment, plant, published_steps

from piezo_hysteresis.identification.steps.frequency_response import welch
from piezo_hysteresis.identification.steps.three_steps import voltage_signals

BAND = (100.0, 8000.0)
"""Compared between these frequencies [Hz]; the noise ends at 10 kHz."""


def figure_5() -> Exhibit:
    """Response from noise with two standard deviations, ARX of order 8, and the mechanics that were simulated."""
    steps, stage = published_steps("bouc_wen"), plant("bouc_wen")
    model = steps.model
    signals = voltage_signals(experiment("bouc_wen").named("noise"), model.voltage_scale, model.displacement_scale)
    measured = welch(signals, model.sample_period, 4096)
    arx = steps.dynamics.response(measured.frequency)
    inside = (measured.frequency > BAND[0]) & (measured.frequency < BAND[1])
    ratio = arx[inside] / measured.value[inside]
    loop = stage.hysteresis
    slope = loop.p2 + loop.A
    small_signal = stage.structure.dc_gain * slope
    decibel, degrees = 20 * np.log10(np.abs(ratio)), np.angle(ratio, deg=True)
    numbers = {
        "ARX over measured, rms [dB]": float(np.sqrt(np.mean(decibel**2))),
        "ARX minus measured, rms [degree]": float(np.sqrt(np.mean(degrees**2))),
        "dc gain of this ARX over K (p2 + A) of the stage [1]": model["arx"].dc_gain / small_signal,
    }

    figure, axes = canvas(1, 2)
    shown = measured.frequency < 9_500.0
    f, width = measured.frequency[shown], 2.0 * measured.deviation[shown]
    size, phase = np.abs(measured.value[shown]), np.unwrap(np.angle(measured.value[shown]))
    axes[0].fill_between(f, size * (1 - width), size * (1 + width), color=MEASURED, alpha=0.25, label="noise, ± 2σ")
    axes[0].plot(f, np.abs(arx[shown]), "--", color=STATIC, label="ARX, na = nb = 8")
    published_g = slope * np.abs(published.MODEL["arx"].response(f, published.MODEL.sample_period))
    axes[0].plot(f, published_g, ":", color=DYNAMIC, label="(p2 + A) G of the paper")
    axes[0].set(xscale="log", xlabel="frequency [Hz]", ylabel="|G| [1]")
    for ax in axes:
        ax.axvspan(*BAND, color="#000000", alpha=0.05, linewidth=0.0, label="100 Hz to 8 kHz")
    axes[0].set_title(f"gain: {numbers['ARX over measured, rms [dB]']:.3f} dB rms apart in the band")
    axes[1].fill_between(f, np.degrees(phase - width), np.degrees(phase + width), color=MEASURED, alpha=0.25)
    axes[1].plot(f, np.degrees(np.unwrap(np.angle(arx[shown]))), "--", color=STATIC)
    axes[1].set(xscale="log", xlabel="frequency [Hz]", ylabel="phase of G [°]")
    axes[1].set_title(f"phase: {numbers['ARX minus measured, rms [degree]']:.2f}° rms apart in the band")
    axes[1].legend(*axes[0].get_legend_handles_labels(), loc="lower left")
    return Exhibit("figure_5", figure, numbers)


if __name__ == "__main__":
    main(figure_5)
