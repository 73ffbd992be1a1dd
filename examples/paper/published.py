"""What the paper prints: its coefficients, its input, its table. Everything else is computed.

Paper: "Modeling of Rate-Dependent Hysteresis in Piezoelectric Actuators Using a Hammerstein-Like Structure with a
Modified Bouc-Wen Model".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from piezo_hysteresis.effects import Arx, PublishedBoucWen
from piezo_hysteresis.model import Model

SAMPLE_PERIOD = 2e-5
"""Sample time of the control board [s]."""

LINEAR = Arx(
    a=(-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198),
    b=(0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408),
    delay=3,
)
"""G(z), Sec. 3.3."""

MBW = PublishedBoucWen(A=-0.7691, beta=4.6075, gamma=-0.8725, p1=-0.1085, p2=2.1925)
"""Modified Bouc-Wen operator, Sec. 3.4; the scale of its input is not printed, v = u/10 V fits the table."""

MBW_OF_FIGURE_1 = PublishedBoucWen(A=-0.7, beta=3.0, gamma=-1.0, p1=-0.1, p2=1.0)
CBW_OF_FIGURE_1 = PublishedBoucWen(A=-0.7, beta=3.0, gamma=-1.0, p1=0.0, p2=1.0)

FREQUENCIES = (1.0, 50.0, 100.0, 200.0, 300.0, 400.0)
"""Columns of Table 1 [Hz]."""
DYNAMIC_ROW = (0.90, 1.80, 2.39, 3.30, 3.54, 4.02)
"""Table 1, RMS error of the dynamic model [%]."""
MBW_ROW = (0.90, 2.29, 3.60, 5.95, 7.98, 10.79)
"""Table 1, RMS error of MBW alone [%]."""

Array = NDArray[np.float64]


def model() -> Model:
    """The Hammerstein-like cascade with the published numbers."""
    return Model((MBW, LINEAR), sample_period=SAMPLE_PERIOD, voltage_scale=10.0)


def sine(frequency: float, periods: int) -> Array:
    """3.5 + 2.5 sin(2π f t) V at the published sample time, the input of Table 1."""
    count = round(periods / frequency / SAMPLE_PERIOD)
    return np.asarray(3.5 + 2.5 * np.sin(2.0 * np.pi * frequency * SAMPLE_PERIOD * np.arange(count)))


def percent_of_range(error: Array, reference: Array) -> float:
    """100·RMS(error) over the peak-to-peak of `reference`: the measure that the table is consistent with."""
    return float(100.0 * np.sqrt(np.mean(error**2)) / np.ptp(reference))
