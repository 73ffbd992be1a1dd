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

"""The force of a spring beyond the linear one, and the static deflection under it."""

from __future__ import annotations

import numpy as np

from ..block import Array, MemorylessBlock
from ..kernel import kernel


@kernel
def force(x, k2, k3):
    """N(x)."""
    return (k2 * abs(x) + k3 * x * x) * x


@kernel
def force_slope(x, k2, k3):
    """∂N/∂x."""
    return 2.0 * k2 * abs(x) + 3.0 * k3 * x * x


@kernel
def settle(w, k2, k3, x):
    """Static deflections x (n,) with x + N(x) = w; NaN if the stiffness becomes zero before."""
    for i in range(w.size):
        x[i] = w[i]
        for _ in range(50):
            stiffness = 1.0 + force_slope(x[i], k2, k3)
            if stiffness <= 0.0:
                x[i] = np.nan
                break
            step = (w[i] - x[i] - force(x[i], k2, k3)) / stiffness
            x[i] += step
            if abs(step) <= 1e-15 * abs(x[i]):
                break


class StaticSoftening(MemorylessBlock):
    """Static deflection, for records slower than the model."""

    def __init__(self, name: str, k2: float, k3: float) -> None:
        self.names = (f"{name}.k2", f"{name}.k3")
        self.k2, self.k3 = k2, k3

    def value(self, x: Array) -> Array:
        settled = np.empty(x.shape)
        settle(x, self.k2, self.k3, settled)
        return settled

    def slope(self, x: Array) -> Array:
        at = self.value(x)
        return np.asarray(1.0 / (1.0 + 2.0 * self.k2 * np.abs(at) + 3.0 * self.k3 * at * at))

    def by_parameter(self, x: Array) -> Array:
        at = self.value(x)
        return -self.slope(x) * np.vstack((np.abs(at) * at, at * at * at))
