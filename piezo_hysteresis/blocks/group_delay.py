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

"""`GroupDelayBlock`: linear dynamics for slow samples, approximated by dc gain and group delay."""

from __future__ import annotations

import numpy as np

from .block import Array, State
from .kernel import kernel
from .linear import LinearBlock, add_mixed


@kernel
def delay_rows(x, gain, part, z, y):
    """Rows of x (r, n), delayed by whole + part samples, times gain, to y (r, n); z (r, whole + 1) are inputs, updated.

    The oldest input of z is the first.
    """
    before, n = z.shape[1], x.shape[1]
    for r in range(x.shape[0]):
        for i in range(min(before, n)):
            near = z[r, i + 1] if i + 1 < before else x[r, 0]
            y[r, i] = gain * ((1.0 - part) * near + part * z[r, i])
        past, late = x[r], y[r, before:]
        for i in range(n - before):
            late[i] = gain * ((1.0 - part) * past[i + 1] + part * past[i])
        for k in range(before):
            z[r, k] = z[r, n + k] if n + k < before else x[r, n + k - before]


class GroupDelayBlock(LinearBlock):
    """y(t) = K·x(t − τ) for x linear between samples.

    Parameters
    ----------
    names : tuple of str
        Parameters on which gain and lag depend.
    gain : float
        dc gain K.
    lag : float
        τ in samples, zero or more.
    gain_slopes, lag_slopes : (p,) ndarray
        Their derivatives by the parameters.
    """

    def __init__(self, names: tuple[str, ...], gain: float, lag: float, gain_slopes: Array, lag_slopes: Array) -> None:
        self.names, self.gain = names, gain
        self.whole = int(lag)
        self.part = lag - self.whole
        self._gain_slopes, self._lag_slopes = gain_slopes, lag_slopes

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, self.whole + 1))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        z = z.copy()
        delay_rows(x, self.gain, self.part, z, y)
        return z

    def gain_slopes(self) -> Array:
        return self._gain_slopes

    def own_rest(self) -> State:
        return None

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        past = np.concatenate((z, x))
        near, far = past[1 : 1 + x.size], past[: x.size]
        by_lag = self.gain * (far - near)
        by_gain = (1.0 - self.part) * near + self.part * far
        rows[:] = 0.0
        add_mixed(np.array((self._gain_slopes, self._lag_slopes)), np.array((by_gain, by_lag)), rows)
