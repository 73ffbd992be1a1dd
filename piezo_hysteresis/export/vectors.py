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

"""Test vectors of an exported model: a drive with swings, a step and holds, and the prediction of the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from ..c_form import CForm
from ..compensation import Inverse
from ..model.model import Model

Array = NDArray[np.float64]

SIZE = 400
"""Number of samples of a self-test."""


@dataclass(frozen=True, eq=False, slots=True)
class Vectors:
    """Inputs and outputs of a self-test.

    Parameters
    ----------
    start : float
        Voltage at which the stage has settled before [V].
    voltage : (n,) ndarray
        Drive [V].
    channels : mapping of str to (n,) ndarray
        Further measured inputs [m] or [K].
    displacement : (n,) ndarray
        Prediction of the model [m].
    inverse : (n,) ndarray or None
        Drive of the inverse for this displacement [V].
    noise_gain : float
        Largest factor by which rounding errors grow in the inverse.
    """

    start: float
    voltage: Array
    channels: Mapping[str, Array]
    displacement: Array
    inverse: Array | None
    noise_gain: float = 1.0


def drive(low: float, high: float, size: int = SIZE) -> Array:
    """Swings that grow and decay, a step, a hold and a small loop between two voltages [V], shape (size,)."""
    t = np.arange(size) / size
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    swing = np.sin(2.0 * np.pi * 7.0 * t) * np.sin(np.pi * t) + 0.1 * np.sin(2.0 * np.pi * 41.0 * t)
    swing[size // 2 : size // 2 + size // 8] = 0.6
    swing[-size // 8 :] = -0.4 + 0.05 * np.sin(2.0 * np.pi * 60.0 * t[-size // 8 :])
    return np.asarray(middle + 0.9 * half * swing, dtype=np.float64)


def vectors(model: Model, inverse: Inverse | None = None) -> Vectors:
    """Values that the exported model and its inverse have to reproduce.

    The voltages are inside the identified range if the model file contains this range, otherwise between 0 V and the
    voltage scale.

    Raises
    ------
    DivergenceError
        If the model diverges with this drive.
    """
    low, high = (_stated(model, f"voltage_{end}", other) for end, other in (("min", 0.0), ("max", model.voltage_scale)))
    voltage = drive(low, high) if high > low else drive(0.0, model.voltage_scale)
    chain, t = model.at(model.sample_period), np.arange(SIZE) / SIZE
    courses = {
        "other_displacement": 0.1 * model.displacement_scale * np.sin(9.0 * t),
        "temperature": 293.15 + np.sin(5.0 * t),
    }
    channels = {name: courses[name] for name in sorted(chain.channels)}
    start = float(voltage[0])
    displacement, _ = chain.run(voltage, chain.rest(start), channels)
    if inverse is None:
        return Vectors(start, voltage, channels, displacement, None)
    wanted, _ = inverse.run(displacement, inverse.rest(start))
    return Vectors(start, voltage, channels, displacement, wanted, inverse.noise_gain)


def rounding(forms: Iterable[CForm]) -> float:
    """Bound of the rounding errors of difference equations after a self-test, relative to their outputs.

    Every term a_k y_(i − k) is rounded, and the error passes 1/A. With poles near 1, as creep has them, the terms
    nearly cancel.
    """
    worst = 0.0
    for form in forms:
        worst = max(worst, rounding(form.parts.values()))
        a = np.append(1.0, np.asarray(form.numbers.get("a", ()), dtype=np.float64))
        response = scipy.signal.lfilter([1.0], a, np.eye(1, SIZE)[0])
        worst = max(worst, float(np.finfo(float).eps * np.abs(a).sum() * np.abs(response).sum()))
    return worst


def _stated(model: Model, key: str, otherwise: float) -> float:
    try:
        value = float(model.provenance[key])
    except (KeyError, ValueError):
        return otherwise
    return value if np.isfinite(value) else otherwise
