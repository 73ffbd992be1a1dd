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

"""`InputComparison`: compares the ARX model from v with that from w, at each amplitude of the noise.

They differ on every stage with hysteresis: under noise, the low-frequency gain of a loop falls towards that of its
polynomial. From w, after the hysteresis, G should be the same at every amplitude.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ...model.model import Model
from ...record import Notice, Record
from ..records.excitation_content import excited_part
from .dynamics import Dynamics, identify_arx
from .linear_start import dynamics_behind
from .regressors import Signals
from .three_steps import voltage_signals

LOW, HIGH = 20.0, 500.0
"""Frequencies at which the gains of G are compared [Hz]."""
STEPS = 500
"""Number of frequencies between them at which the phase is followed, which a mode turns by half a cycle."""
TOLERANCE = 0.05
"""Relative difference from which an amplitude dependence is reported."""


@dataclass(frozen=True, slots=True)
class InputComparison:
    """G seen from v and from w at one noise amplitude.

    Parameters
    ----------
    amplitude : float
        RMS of the drive about its mean [V].
    from_v, from_w : float
        |G(20 Hz)|/|G(500 Hz)|.
    lag_from_v, lag_from_w : float
        Phase lag at 500 Hz as a time [s].
    gain_from_w : float
        |G(500 Hz)| from w.
    """

    amplitude: float
    from_v: float
    from_w: float
    lag_from_v: float
    lag_from_w: float
    gain_from_w: float

    def __str__(self) -> str:
        return (
            f"noise of {self.amplitude:.3g} V rms: |G({LOW:g} Hz)|/|G({HIGH:g} Hz)| is {self.from_w:.3f} without and "
            f"{self.from_v:.3f} with the hysteresis; the lag at {HIGH:g} Hz is {self.lag_from_w * 1e6:.4g} and "
            f"{self.lag_from_v * 1e6:.4g} µs"
        )


def _shape(dynamics: Dynamics) -> tuple[float, float, float]:
    gains = dynamics.response(np.linspace(LOW, HIGH, STEPS))
    turned = -np.unwrap(np.angle(gains * np.sign(gains[0].real)))  # a reversed sensor is no lag
    return abs(gains[0]) / abs(gains[-1]), float(turned[-1]) / (2.0 * np.pi * HIGH), abs(gains[-1])


def compare_inputs(
    model: Model, records: Sequence[Record], noise: Collection[int], delay: int, orders: tuple[int, int]
) -> tuple[tuple[InputComparison, ...], tuple[Notice, ...]]:
    """Identify G from v and from w of the model, separately for every noise amplitude.

    Parameters
    ----------
    model : Model
        Model with a fitted hysteresis.
    records : sequence of Record
        The experiment, in order.
    noise : collection of int
        Indices of the noise records, at the model's sample period.
    delay : int
        Delay d [samples].
    orders : (int, int)
        na and nb.

    Returns
    -------
    comparisons : tuple of InputComparison
        Comparisons in rising order of amplitude; records whose amplitudes differ by less than 20 % count as one.
    notices : tuple of Notice
        ``amplitude_dependent``, if G from w differs between two amplitudes of the noise.
    """
    rms = {i: float(np.std(excited_part(records[i]).voltage)) for i in noise}
    groups: list[list[int]] = []
    for index in sorted(rms, key=lambda i: rms[i]):
        if groups and rms[index] <= 1.2 * rms[groups[-1][0]]:
            groups[-1].append(index)
        else:
            groups.append([index])
    comparisons = []
    for group in groups:
        signals: Signals = voltage_signals([records[i] for i in group], model.voltage_scale, model.displacement_scale)
        shape_v, lag_v, _ = _shape(identify_arx(signals, delay, model.sample_period, orders))
        shape_w, lag_w, gain_w = _shape(dynamics_behind(model, records, group, delay, orders))
        comparisons.append(
            InputComparison(float(np.mean([rms[i] for i in group])), shape_v, shape_w, lag_v, lag_w, gain_w)
        )
    notices = []
    gains = [c.gain_from_w for c in comparisons]
    if len(gains) > 1 and max(gains) > (1.0 + TOLERANCE) * min(gains):
        message = ", ".join(f"{c.gain_from_w:.4g} at {c.amplitude:.3g} V" for c in comparisons)
        notices.append(Notice("amplitude_dependent", f"|G({HIGH:g} Hz)| depends on the amplitude: {message}", "noise"))
    return tuple(comparisons), tuple(notices)
