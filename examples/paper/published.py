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

"""The printed numbers of the paper: its coefficients, its input, its table. Everything else is computed.

Paper: "Modeling of Rate-Dependent Hysteresis in Piezoelectric Actuators Using a Hammerstein-Like Structure with a
Modified Bouc-Wen Model".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from piezo_hysteresis import load
from piezo_hysteresis.effects import PublishedBoucWen

MODEL = load(Path(__file__).parents[2] / "config" / "published_stage.yaml")
"""The Hammerstein-like cascade of Sec. 3.3 and 3.4 with the printed numbers; v = u/10 V fits Table 1."""

MBW_OF_FIGURE_1 = PublishedBoucWen(A=-0.7, beta=3.0, gamma=-1.0, p1=-0.1, p2=1.0)
CBW_OF_FIGURE_1 = PublishedBoucWen(A=-0.7, beta=3.0, gamma=-1.0, p1=0.0, p2=1.0)

FREQUENCIES = (1.0, 50.0, 100.0, 200.0, 300.0, 400.0)
"""Columns of Table 1 [Hz]."""
DYNAMIC_ROW = (0.90, 1.80, 2.39, 3.30, 3.54, 4.02)
"""Table 1, RMS error of the dynamic model [%]."""
MBW_ROW = (0.90, 2.29, 3.60, 5.95, 7.98, 10.79)
"""Table 1, RMS error of MBW alone [%]."""

Array = NDArray[np.float64]


def sine(frequency: float, periods: int) -> Array:
    """3.5 + 2.5 sin(2π f t) V at the published sample time, the input of Table 1."""
    count = round(periods / frequency / MODEL.sample_period)
    return np.asarray(3.5 + 2.5 * np.sin(2.0 * np.pi * frequency * MODEL.sample_period * np.arange(count)))


def percent_of_range(error: Array, reference: Array) -> float:
    """100·RMS(error) over the peak-to-peak of `reference`: the measure that the table is consistent with."""
    return float(100.0 * np.sqrt(np.mean(error**2)) / np.ptp(reference))
