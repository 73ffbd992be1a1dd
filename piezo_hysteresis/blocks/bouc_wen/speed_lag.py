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

"""The speed of the drive, followed with a lag, in the rate law of the Bouc-Wen loop.

The lagged speed q obeys τ dq/dt = |v̇| − q. |v̇| is constant within a sample, so that q is exact at its end. The loop
takes the mean of q over the step. A jump of a slow record takes the sample period of the model, and the drive rests for
what is left of the sample.
"""

from __future__ import annotations

from math import exp

import numpy as np
from numpy.typing import NDArray

from ..kernel import inlined, kernel
from .bouc_wen_kernel import JUMP, step_at_speed

FADE, SHARE, LEFT, FADE_BY, SHARE_BY, LEFT_BY = range(6)
"""Columns of the array of `speed_lag`: what is left of a distance at the end of the step, its mean over the step, what
is left of q at the end of a rest behind it, and their derivatives by τ."""


def speed_lag(tau: float, sample_period: float, jump_period: float) -> NDArray[np.float64]:
    """Coefficients of the lag, for a step within a sample in the first row, and for a jump in the second.

    Parameters
    ----------
    tau : float
        Time constant of the lag [s], at least 0.
    sample_period, jump_period : float
        Duration of a step, and of a jump [s].

    Returns
    -------
    (2, 6) ndarray
    """

    def left_after(time: float) -> tuple[float, float]:
        """exp(−t/τ), and its derivative by τ."""
        if tau == 0.0:
            return float(time == 0.0), 0.0
        left = exp(-time / tau)
        return left, left * time / tau / tau

    def row(period: float) -> tuple[float, ...]:
        fade, fade_by = left_after(period)
        left, left_by = left_after(max(0.0, sample_period - period))
        return fade, tau * (1.0 - fade) / period, left, fade_by, (1.0 - fade - tau * fade_by) / period, left_by

    return np.array([row(sample_period), row(jump_period)])


@kernel
def run_lagged(v, p, p1, p2, sample_period, jump_period, lag, state, w):
    """`run_general` with the `lag` (2, 6) of the speed; state = [h, v_last, q]."""
    h, last, lagged = state[0], state[1], state[2]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        row = 1 if abs(dv) > JUMP else 0
        speed = abs(dv) / (jump_period if row else sample_period)
        behind = lagged - speed
        if dv != 0.0:
            last = x
            h = step_at_speed(h, dv, p, speed + lag[row, SHARE] * behind)
        lagged = lag[row, LEFT] * (speed + lag[row, FADE] * behind)
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1], state[2] = h, last, lagged


@inlined
def lagged_slopes(lag, behind, speed, behind_by, speed_by, of_tau):
    """Derivatives of the mean speed, and of the lagged speed after the sample.

    `lag` is a row of `speed_lag`, and `behind` is q − |v̇| before the sample; `behind_by` and `speed_by` are their
    derivatives. `of_tau` is 1 for those by τ, otherwise 0.
    """
    end = speed + lag[FADE] * behind
    end_by = speed_by + lag[FADE] * behind_by + of_tau * lag[FADE_BY] * behind
    mean_by = speed_by + lag[SHARE] * behind_by + of_tau * lag[SHARE_BY] * behind
    return mean_by, lag[LEFT] * end_by + of_tau * lag[LEFT_BY] * end


LAGGED_STEP = """\
const double dv = x - s->v;
const int jumps = fabs(dv) > JUMP;
const double speed = fabs(dv) / (jumps ? jump_period : period), behind = s->q - speed;
if (dv != 0.0) {
    s->v = x;
    s->h = step_at_speed(s->h, dv, loop, speed + share[jumps] * behind);
}
s->q = left[jumps] * (speed + fade[jumps] * behind);
return p1 * x * x * x + p2 * x + s->h;"""
"""C code of `run_lagged` for one sample."""
