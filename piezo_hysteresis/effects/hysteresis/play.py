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

"""One play: its position, p_i = max(v_i − r, min(v_i + r, p_(i−1))), and the derivatives of it."""

from __future__ import annotations

from ...blocks.kernel import kernel


@kernel
def play_positions(v, radius, before, p):
    """Positions p (n,) of a play that was at `before`; returns the last one."""
    for i in range(v.size):
        before = p[i] = max(v[i] - radius, min(v[i] + radius, before))
    return before


@kernel
def play_slopes(v, dv, radius, before, p, slope, dp):
    """Derivatives dp (n,) of `play_positions` p (n,) from dv (n,) and that of `before`, `slope`; returns the last one.

    Where a side of the play just touches the position, the derivative is the one for a growing parameter.
    """
    for i in range(v.size):
        low, high = v[i] - radius, v[i] + radius
        if before < low or before > high:
            slope = dv[i]
        elif before == low:
            slope = max(slope, dv[i])
        elif before == high:
            slope = min(slope, dv[i])
        dp[i], before = slope, p[i]
    return slope
