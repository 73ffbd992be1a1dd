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

"""The dynamics of a model without its slow relaxations, which are not dynamics of the stage.

In a fit without creep, G gets poles at a few hertz, each close to a zero. They imitate creep in fast records. In slow
records G is a gain and a delay, so these poles have no influence.
"""

from __future__ import annotations

import numpy as np

from ...effects import Arx
from ...model.model import Model

SMALL = 0.1
"""Largest share of the response of a relaxation that counts as creep; that of a slow amplifier is larger."""
REAL = 1e-9
"""Imaginary part below which a root is real."""


def quick_dynamics(model: Model, longest: float) -> Model:
    """The model without relaxations of G slower than `longest` [s], with the same dc gain.

    Parameters
    ----------
    model : Model
        Any model; without `arx` it is returned unchanged.
    longest : float
        Time constant from which a real pole counts as slow [s].
    """
    if Arx.name not in model:
        return model
    arx = model[Arx.name]
    a, b = np.append(1.0, arx.array("a")), arx.array("b")
    poles, zeros = np.roots(a), np.roots(b)
    slow = [p.real for p in poles if abs(p.imag) < REAL and np.exp(-model.sample_period / longest) < p.real < 1.0]
    removed = 0
    for pole in sorted(slow, reverse=True):
        beside = [k for k, q in enumerate(zeros) if abs(q.imag) < REAL and _share(pole, q.real) < SMALL]
        if beside:
            zeros = np.delete(zeros, min(beside, key=lambda k: abs(zeros[k] - pole)))
            poles = np.delete(poles, np.argmin(np.abs(poles - pole)))
            removed += 1
    if not removed or b.sum() == 0.0:
        return model
    unused = np.zeros(removed)
    lean_a, lean_b = np.append(np.poly(poles).real, unused), np.append(np.poly(zeros).real, unused)
    lean_b = np.append(np.zeros(b.size - lean_b.size), lean_b)  # leading zeros of b are a delay
    lean_b *= b.sum() / a.sum() * lean_a.sum() / lean_b.sum()
    return model.with_effect(arx.with_values(a=tuple(lean_a[1:].tolist()), b=tuple(lean_b.tolist())))


def _share(pole: float, zero: float) -> float:
    """Delayed share of the final response of (1 − zero z⁻¹)/(1 − pole z⁻¹)."""
    return abs(1.0 - (1.0 - pole) / (1.0 - zero)) if zero != 1.0 else np.inf
