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
from .linear import LinearBlock


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

    def _two_taps(self, x: Array, z: Array) -> tuple[Array, Array, Array]:
        whole = np.concatenate((z, x), axis=1)
        return whole[:, 1 : 1 + x.shape[1]], whole[:, : x.shape[1]], whole[:, x.shape[1] :].copy()

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        near, far, z = self._two_taps(x, z)
        y[:] = self.gain * ((1.0 - self.part) * near + self.part * far)
        return z

    def gain_slopes(self) -> Array:
        return self._gain_slopes

    def own_rest(self) -> State:
        return None

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        near, far, _ = self._two_taps(x[None, :], z[None, :])
        by_lag = self.gain * (far[0] - near[0])
        by_gain = (1.0 - self.part) * near[0] + self.part * far[0]
        rows[:] = np.outer(self._gain_slopes, by_gain) + np.outer(self._lag_slopes, by_lag)
