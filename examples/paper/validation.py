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

"""Errors of a model on the validation sines of Table 1, in the measure that the paper is consistent with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import published
from matplotlib.axes import Axes
from numpy.typing import NDArray
from two_stages import experiment, last_period

from piezo_hysteresis import Model, Record


def sine(operator: str, frequency: float) -> Record:
    """The validation sine of one frequency [Hz] on one stage."""
    return experiment(operator).named(f"sine_{frequency:g}hz")[0]


def last_loop(model: Model, record: Record, frequency: float) -> tuple[NDArray, NDArray, NDArray]:
    """Voltage [V], measured and free-run displacement [m] of the last period."""
    part = last_period(record, frequency)
    return record.voltage[part], record.displacement[part], model.simulate(record)[0][part]


def error_row(model: Model, operator: str) -> list[float]:
    """RMS error in % of peak-to-peak at the frequencies of Table 1."""
    row = []
    for frequency in published.FREQUENCIES:
        _, measured, predicted = last_loop(model, sine(operator, frequency), frequency)
        row.append(published.percent_of_range(measured - predicted, measured))
    return row


def draw_loops(axes: list[Axes], model: Model, operator: str, label: str, style: Mapping[str, object]) -> list[float]:
    """Simulated stage and model: the loop at every frequency, one per axes; returns the errors."""
    row = error_row(model, operator)
    for ax, frequency, error in zip(axes, published.FREQUENCIES, row, strict=True):
        voltage, measured, predicted = last_loop(model, sine(operator, frequency), frequency)
        voltage, measured, predicted = (np.append(x, x[0]) for x in (voltage, measured, predicted))  # close the loop
        ax.plot(voltage, measured * 1e6, color="#000000", label="simulated stage")
        ax.plot(voltage, predicted * 1e6, "--", label=label, **style)
        ax.set(xlabel="drive u [V]", ylabel="displacement y [µm]")
        ax.set_title(f"{frequency:g} Hz: error {error:.2f} % of peak-to-peak", fontsize="medium")
    axes[0].legend()
    return row
