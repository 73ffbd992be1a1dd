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

"""`nearest_path`: the nearest path that can be reached inside the limits: shifted, scaled, or slower."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..model.chain import ChainState
from ..model.model import Model
from .approach import APPROACH, smooth_transition, transition_samples
from .band import Band
from .limit_check import reachable
from .limits import Limits
from .reachability import NearestPath

Array = NDArray[np.float64]

STEPS = 8
"""Number of bisection steps in the search for the nearest path, after the first trial that works."""

FIRST_TRIALS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 0.99)
"""First trials of the search for the nearest path, as shares of the largest change."""

NEARLY = 0.9
"""First trial of a shift, as a share of the distance by which a path is outside the range of the stage."""


def nearest_path(
    model: Model,
    limits: Limits,
    y: Array,
    state: ChainState,
    *,
    band: Band | None = None,
    approximate: bool = False,
    approach: float = APPROACH,
) -> NearestPath:
    """The nearest path that can be reached, after an approach from the present position of the stage.

    Parameters
    ----------
    model, limits, band, approximate
        As for `reachable`.
    y : (n,) ndarray
        Displacement of the path, without the approach [m].
    state : ChainState
        State of the model before the approach.
    approach : float
        Duration of the approach [s].
    """
    span, middle = float(np.ptp(y)), 0.5 * float(y.min() + y.max())

    at_start = float(model.run([state.inputs[0]], state)[0][0])
    count = transition_samples(approach, model.sample_period)

    def is_whole(path: Array, low_pass: Band | None = band) -> bool:
        """Whether the path can be reached after an approach from the present position of the stage."""
        whole = np.concatenate((smooth_transition(at_start, float(path[0]), count), path))
        return reachable(
            model, limits, whole, start=state, band=low_pass, approximate=approximate, approach=count
        ).is_whole

    most = span or model.displacement_scale
    low, high = _range(model, limits, state, count)
    offsets = []
    for sign, outside in ((1.0, low - float(y.min())), (-1.0, float(y.max()) - high)):
        trials = [NEARLY * outside] if outside > 0.0 else []
        trials += [max(outside, 0.0) + share * most for share in FIRST_TRIALS]
        shift = _smallest(lambda c, s=sign: is_whole(y + s * c), trials)  # type: ignore[misc]
        offsets += [] if shift is None else [sign * shift]
    shrink = _smallest(lambda c: is_whole(middle + (1.0 - c) * (y - middle)), FIRST_TRIALS)
    usual = Band.of(model.sample_period)

    def slower(c: float) -> Band:
        return Band(usual.passed * 2.0 ** (-8.0 * c), usual.stopped * 2.0 ** (-8.0 * c), 5.0 * usual.length)

    lower = _smallest(lambda c: is_whole(y, slower(c)), FIRST_TRIALS)
    return NearestPath(
        min(offsets, key=abs, default=None),
        None if shrink is None or shrink >= 1.0 else 1.0 - shrink,
        None if lower is None else usual.passed * 2.0 ** (-8.0 * lower),
    )


def _range(model: Model, limits: Limits, state: ChainState, count: int) -> tuple[float, float]:
    """Displacement after a smooth transition of `count` samples to either limit [m]; infinite without limits."""
    voltages = limits.voltage_min, limits.voltage_max
    if not np.isfinite(voltages).all():
        return -np.inf, np.inf
    ways = [np.append(smooth_transition(state.inputs[0], u, count), u) for u in voltages]
    low, high = sorted(float(model.run(way, state)[0][-1]) for way in ways)
    return low, high


def _smallest(works: Callable[[float], bool], trials: Sequence[float]) -> float | None:
    """Smallest change that works, found by bisection; None if none of the ascending `trials` works.

    A change that is larger than necessary may not work either.
    """
    tried = [0.0, *trials]
    found = next((k for k in range(1, len(tried)) if works(tried[k])), None)
    if found is None:
        return None
    low, high = tried[found - 1], tried[found]
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if works(middle) else (middle, high)
    return high
