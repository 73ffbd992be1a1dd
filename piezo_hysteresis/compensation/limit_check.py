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

"""`reachable`: the parts of a path that cannot be reached inside the limits, and the nearest path that can."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..effects import ChainPosition
from ..effects.drive.amplifier_saturation import UNLIMITED
from ..model.chain import ChainState
from ..model.model import Model
from ..model.samples import samples
from .approach import APPROACH, settled_start, smooth_transition
from .band import Band
from .inverse import Inverse
from .limits import Limits
from .reachability import NearestPath, Reachability, UnreachablePart

Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Deviations below this share of the range of the path count as zero."""

STEPS = 8
"""Number of bisection steps in the search for the nearest path, after the first trial that works."""

FIRST_TRIALS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 0.99)
"""First trials of the search for the nearest path, as shares of the largest change."""


def reachable(
    model: Model,
    limits: Limits,
    wanted: ArrayLike,
    *,
    start: ChainState | None = None,
    band: Band | None = None,
    approximate: bool = False,
    search: bool = True,
) -> Reachability:
    """Compare a path with and without the limits of the drive and of the amplifier, from the model alone.

    Parameters
    ----------
    model : Model
        Model of the stage.
    limits : Limits
        Limits of the drive.
    wanted : (n,) array_like
        Displacement at the model's sample period [m].
    start : ChainState, optional
        State of the model before the path. Default: at rest at 0 V, or at the limit that is nearest to it.
    band, approximate
        As for `Inverse`.
    search : bool
        Also search for the nearest path that can be reached.

    Returns
    -------
    Reachability

    Raises
    ------
    ModelError
        If the path is empty or not finite, or the model cannot be inverted.
    """
    y = samples(wanted, "displacement")
    state = start or settled_start(model, limits)
    limits = limits.resolved
    limited = Inverse(model, limits, band=band, approximate=approximate)
    ideal = without_amplifier_limits(model)
    free = Inverse(ideal, Limits(resolution=limits.resolution), band=band, approximate=approximate)
    given, reached = _followed(limited, y, state)
    needed, aim = _followed(free, y, state)
    span = float(np.ptp(y)) or float(np.abs(y).max()) or model.displacement_scale
    span = min(span, model.displacement_scale)  # what is too large is not allowed a larger error
    off = reached - aim
    parts = _parts(off, needed, span, limits, model, limited.preview, aim, ideal is not model)
    nearest = None
    if parts and search:
        nearest = nearest_path(model, limits, y, state, band=band, approximate=approximate)
    return Reachability(parts, nearest, reached, given)


def without_amplifier_limits(model: Model) -> Model:
    """The model with an amplifier that reaches every voltage at every slope; the model itself if it has such a one."""
    limits = [
        (f"{e.name}.{p.name}", p.off)
        for e in model.effects
        for p in e.parameters
        if e.place is ChainPosition.DRIVE and p.off is not None and abs(p.off) >= UNLIMITED
    ]
    return model.with_values(dict(limits)) if limits else model


def _followed(inverse: Inverse, y: Array, state: ChainState) -> tuple[Array, Array]:
    """Drive for a path, and the displacement that the model predicts for it during the path."""
    u, _ = inverse.command(y, inverse.resume(state))
    reached, _ = inverse.model.run(u, state)
    return u, reached[inverse.preview :]


def _parts(
    off: Array,
    needed: Array,
    span: float,
    limits: Limits,
    model: Model,
    preview: int,
    aim: Array,
    is_limited: bool,
) -> tuple[UnreachablePart, ...]:
    period = model.sample_period
    bad = np.flatnonzero(np.abs(off) > TOLERANCE * span)
    if not bad.size:
        return ()
    gap = max(1, round(2e-3 / period))
    ends = np.flatnonzero(np.diff(bad) > gap)
    begins = np.concatenate((bad[:1], bad[ends + 1]))
    stops = np.concatenate((bad[ends], bad[-1:]))
    lowest, direction = _at_the_lowest_voltage(model, limits)
    found = []
    for a, b in zip(begins, stops, strict=True):
        here = needed[a : b + preview + 1]
        low, high = float(here.min()), float(here.max())
        slew = float(np.abs(np.diff(here)).max(initial=0.0)) / period
        beyond = {
            "voltage_min": limits.voltage_min - low,
            "voltage_max": high - limits.voltage_max,
            "max_slew_rate": (slew - limits.max_slew_rate) * period,
        }
        limit = max(beyond, key=lambda name: beyond[name])
        if is_limited and beyond[limit] <= 0.0:
            limit = "amplifier"
        worst = a + int(np.abs(off[a : b + 1]).argmax())
        found.append(
            UnreachablePart(
                period * float(a),
                period * float(b + 1),
                float(off[worst]),
                low,
                high,
                slew,
                limit,
                limit == "voltage_min" and direction * (float(aim[worst]) - lowest) >= -TOLERANCE * span,
            )
        )
    return tuple(found)


def _at_the_lowest_voltage(model: Model, limits: Limits) -> tuple[float, float]:
    """Displacement of a stage settled at `voltage_min` [m], and the direction in which a higher voltage moves it (±1).

    Zeros without a `voltage_min`.
    """
    if not np.isfinite(limits.voltage_min):
        return 0.0, 0.0
    higher = min(limits.voltage_max, limits.voltage_min + model.voltage_scale)
    at, above = (float(model.run([u], model.rest(u))[0][0]) for u in (limits.voltage_min, higher))
    return at, float(np.sign(above - at))


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

    def is_whole(path: Array, low_pass: Band | None = band) -> bool:
        return reachable(
            model, limits, path, start=state, band=low_pass, approximate=approximate, search=False
        ).is_whole

    at_start = float(model.run([state.inputs[0]], state)[0][0])

    def with_approach(path: Array) -> Array:
        """The path after an approach from the present position of the stage."""
        way = smooth_transition(at_start, float(path[0]), round(approach / model.sample_period))
        return np.concatenate((way, path))

    most = span or model.displacement_scale
    shifts = [_smallest(lambda c, s=s: is_whole(with_approach(y + s * c)), most) for s in (1, -1)]  # type: ignore[misc]
    offsets = [s * c for s, c in zip((1.0, -1.0), shifts, strict=True) if c is not None]
    shrink = _smallest(lambda c: is_whole(with_approach(middle + (1.0 - c) * (y - middle))), 1.0)
    usual = Band.of(model.sample_period)

    def slower(c: float) -> Band:
        return Band(usual.passed * 2.0 ** (-8.0 * c), usual.stopped * 2.0 ** (-8.0 * c), 0.02)

    lower = _smallest(lambda c: is_whole(with_approach(y), slower(c)), 1.0)
    return NearestPath(
        min(offsets, key=abs, default=None),
        None if shrink is None or shrink >= 1.0 else 1.0 - shrink,
        None if lower is None else usual.passed * 2.0 ** (-8.0 * lower),
    )


def _smallest(works: Callable[[float], bool], most: float) -> float | None:
    """Smallest change up to `most` that works, found by bisection; None if none of `FIRST_TRIALS` works.

    A change that is larger than necessary may not work either.
    """
    tried = [0.0, *(most * share for share in FIRST_TRIALS)]
    found = next((k for k in range(1, len(tried)) if works(tried[k])), None)
    if found is None:
        return None
    low, high = tried[found - 1], tried[found]
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if works(middle) else (middle, high)
    return high
