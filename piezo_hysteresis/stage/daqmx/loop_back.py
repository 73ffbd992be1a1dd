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

"""The delay of the card itself, measured with its output wired to its input. It is not a part of the stage's delay."""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate, correlation_lags

from ...errors import StageError
from ..stage import StreamingStage

_COUNT = 4096
"""Number of samples of the test signal."""
_LEAST_CORRELATION = 0.9
"""Smallest correlation from which the delay is accepted."""


def loop_back_delay(stage: StreamingStage, amplitude: float = 1.0) -> float:
    """Measure the delay from output to input [s], to be kept as `DaqmxSetup.io_delay`.

    Wire the analogue output to the displacement input, with no amplifier and no stage between them, and open the stage
    with ``io_delay=0`` and without `voltage_input`.

    Parameters
    ----------
    stage : StreamingStage
        On that card; noise is played around its present voltage, to which it returns.
    amplitude : float
        Peak of the noise [V]. The noise lies above the present voltage if the range allows it, otherwise below.

    Returns
    -------
    float
        Delay [s], from the peak of the cross-correlation, refined by a parabola to a part of a sample.

    Raises
    ------
    StageError
        If the measured signal is not the output signal.
    """
    d, start = stage.description, stage.voltage
    side = 1.0 if start + amplitude <= d.voltage_max else -1.0
    drive = start + side * amplitude * np.random.default_rng(0).random(_COUNT)
    latency = round(d.latency / stage.sample_period)
    rest = np.full(latency + _COUNT // 4, start)
    parts = [stage.exchange(drive), stage.exchange(rest)]
    applied = np.concatenate([p.voltage for p in parts])
    measured = np.concatenate([p.displacement for p in parts])
    u, y = applied - applied.mean(), measured - measured.mean()
    scale = np.sqrt(float(u @ u) * float(y @ y))
    if scale == 0:
        raise StageError(f"{d.name}: the input does not move with the output, expected them wired together")
    correlation = correlate(y, u, mode="full") / scale
    lags = correlation_lags(y.size, u.size)
    peak = int(np.argmax(np.abs(correlation)))
    if abs(correlation[peak]) < _LEAST_CORRELATION or lags[peak] < 0:
        raise StageError(
            f"{d.name}: correlation {correlation[peak]:.2f} at {lags[peak]} samples, expected more than "
            f"{_LEAST_CORRELATION} at a positive delay; wire the output to the displacement input"
        )
    before, at, after = np.abs(correlation[peak - 1 : peak + 2])
    return float((lags[peak] + 0.5 * (before - after) / (before - 2 * at + after)) * stage.sample_period)
