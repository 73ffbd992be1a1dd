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

"""The published model by Eq. (5) to (7), written apart from the package: the truth that identification must find."""

import numpy as np
from scipy.signal import lfilter

from piezo_hysteresis.blocks.kernel import kernel

SAMPLE_PERIOD = 2e-5
DELAY = 3
A_Z = np.array([1.0, -0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198])
B_Z = np.array([0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408])
GAIN = 0.24641
LOOP = {"A": -0.7691, "beta": 4.6075, "gamma": -0.8725, "p1": -0.1085, "p2": 2.1925}
STROKE = 0.479
"""Output at 10 V from rest, normalised, which is what a percentage of noise refers to."""


@kernel
def _loop(v, a, beta, gamma):
    h = np.zeros(v.size)
    for i in range(1, v.size):
        dv = v[i] - v[i - 1]
        h[i] = h[i - 1] + a * dv - beta * abs(dv) * h[i - 1] - gamma * dv * abs(h[i - 1])
    return h


def hysteresis_output(voltage):
    """W for a drive in volts from rest, v = V/10."""
    v = voltage / 10.0
    return LOOP["p1"] * v**3 + LOOP["p2"] * v + _loop(v, LOOP["A"], LOOP["beta"], LOOP["gamma"])


def linear_output(w):
    """G driven by w, settled at its first value."""
    numerator = np.concatenate((np.zeros(DELAY), B_Z))
    return B_Z.sum() / A_Z.sum() * w[0] + lfilter(numerator, A_Z, w - w[0])


def displacement(voltage):
    """Noise-free output for a drive in volts from rest, normalised."""
    return linear_output(hysteresis_output(voltage))
