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

"""Kernel of a stage with several axes: responses to all drives, corrected by hysteresis of the elongations."""

from __future__ import annotations

import math

import numpy as np

from .kernel import kernel


@kernel
def coupled_axes(u, taps, elongation, radii, decay, reference, power, history, plays, y):
    """Displacements of one block; `power`, `history` and `plays` are the state and are changed in place.

    Parameters
    ----------
    u : (n, m) array
        Drive voltages [V].
    taps : (s, p, l, f) array
        Impulse responses of every pass, the oldest sample first, f = m (3 + r).
    elongation : (m, p) array
        Matrix from displacements to elongations of the actuators, in volts of drive [V/m].
    radii : (r,) array
        Half widths of the play operators [V].
    decay, reference : float
        Decay of the running mean square per sample [1], and the level at which the amplitude is 1 [V].
    power : (1,) array
        Running mean square of the drives [V²].
    history : (s, l - 1 + n, f) array
        Regressors; the first l - 1 rows of every pass come from the block before.
    plays : (s, m, r) array
        Play operators of every pass [V].
    y : (n, p) array
        Displacements of the last pass [m], the result.
    """
    passes, outputs, length, terms = taps.shape
    inputs = u.shape[1]
    sums = np.empty((outputs, terms))
    for k in range(u.shape[0]):
        square = 0.0
        for i in range(inputs):
            square += u[k, i] * u[k, i]
        power[0] += (1.0 - decay) * (square / inputs - power[0])
        amplitude = math.sqrt(power[0]) / reference
        for s in range(passes):
            row = history[s, k + length - 1]
            for i in range(inputs):
                row[i] = u[k, i]
                row[inputs + i] = amplitude * u[k, i]
                row[2 * inputs + i] = amplitude * amplitude * u[k, i]
                if s > 0:
                    z = 0.0
                    for o in range(outputs):
                        z += elongation[i, o] * y[k, o]
                    for r in range(radii.size):
                        plays[s, i, r] = min(max(plays[s, i, r], z - radii[r]), z + radii[r])
                        row[(3 + r) * inputs + i] = plays[s, i, r]
            used = row.size if s > 0 else 3 * inputs
            sums[:] = 0.0  # one for each regressor: independent sums are computed in parallel
            for j in range(length):
                for o in range(outputs):
                    for f in range(used):
                        sums[o, f] += taps[s, o, j, f] * history[s, k + j, f]
            for o in range(outputs):
                total = 0.0
                for f in range(used):
                    total += sums[o, f]
                y[k, o] = total
