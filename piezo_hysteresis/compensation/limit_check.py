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

"""`reachable`: the parts of a path that cannot be reached inside the limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..effects import ChainPosition
from ..effects.drive.amplifier_saturation import UNLIMITED
from ..model.chain import ChainState
from ..model.model import Model
from ..model.samples import samples
from .approach import APPROACH, settled_start
from .band import Band
from .expected_error import free_run_error
from .inverse import Inverse
from .limits import Limits
from .reachability import Reachability, UnreachablePart

Array = NDArray[np.float64]

LEAST, MOST = 1e-4, 1e-2
"""Deviations below the free-run error of the model count as zero; these shares of the range of the path bound it."""
RESOLVED = 1e-4
"""Ranges of a path below this share of that with the way to it count as this share: they are near rounding."""


def reachable(
    model: Model,
    limits: Limits,
    wanted: ArrayLike,
    *,
    start: ChainState | None = None,
    band: Band | None = None,
    approximate: bool = False,
    approach: int = 0,
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
    approach : int
        Number of the first samples that are the way to the path. It may deviate more where the path is much smaller.

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
    no_voltage = _is_at_an_end(needed, free, state)[free.preview :]
    off = reached - np.where(no_voltage, y, aim)
    span = float(np.ptp(y)) or float(np.abs(y).max()) or model.displacement_scale
    allowed = np.full(y.size, _allowed(model, span))
    allowed[approach:] = _allowed(model, max(float(np.ptp(y[approach:])) or span, RESOLVED * span))
    bad = np.flatnonzero(np.abs(off) > allowed)
    lowest, direction = _at_the_lowest_voltage(model, limits)
    settling = np.full(max(round(APPROACH / model.sample_period), limited.preview, 1), limits.voltage_min)
    steps = np.diff(needed, prepend=state.inputs[0])
    parts, moved, played = [], state, 0
    for a, b in _runs(bad, max(1, round(2e-3 / model.sample_period))):
        worst = a + int(np.abs(off[a : b + 1]).argmax())
        tolerance = float(allowed[worst])
        kept = direction * (float(aim[worst]) - lowest) >= -tolerance
        along = slice(a, b + free.preview + 1)
        part = _part(model, limits, needed[along], steps[along], a, b + 1, float(off[worst]))
        if no_voltage[worst]:
            part = replace(part, limit="model", other_limits=())
        if kept and part.limit == "voltage_min":  # a drive that is only too late would still get there
            _, moved = model.run(given[played : worst + limited.preview + 1], moved)
            played = worst + limited.preview + 1
            held, _ = model.run(settling, moved)
            part = replace(part, after_loop=direction * (float(held[-1]) - float(aim[worst])) > tolerance)
        parts.append(part)
    return Reachability(tuple(parts), reached, given)


def _allowed(model: Model, span: float) -> float:
    """Deviation that counts as zero on a path of this range [m]."""
    span = min(span, model.displacement_scale)  # what is too large is not allowed a larger error
    return float(np.clip(free_run_error(model) or 0.0, LEAST * span, MOST * span))


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


def _is_at_an_end(u: Array, inverse: Inverse, state: ChainState) -> NDArray[np.bool_]:
    """Where a drive (n,) [V] of the inverse is at an end of the voltages that it searches, shape (n,)."""
    v, chain = u, inverse.chain
    for k in range(chain.labels.index("voltage_scale") + 1):
        v, _ = chain.blocks[k].run(v, state.blocks[k])
    low, high = inverse.ends
    slack = 1e-9 * (high - low)
    return np.asarray((v <= low + slack) | (v >= high - slack))


def _runs(indices: NDArray[np.intp], gap: int) -> list[tuple[int, int]]:
    """First and last of every run of indices; a run ends where more than `gap` are missing."""
    if not indices.size:
        return []
    ends = np.flatnonzero(np.diff(indices) > gap)
    firsts, lasts = np.append(indices[0], indices[ends + 1]), np.append(indices[ends], indices[-1])
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def _part(
    model: Model, limits: Limits, needed: Array, steps: Array, begin: int, end: int, largest: float
) -> UnreachablePart:
    """The part from sample `begin` to `end`, that would need the drive `needed` with the `steps` to its samples [V]."""
    period = model.sample_period
    low, high = float(needed.min()), float(needed.max())
    slew = float(np.abs(steps).max()) / period
    beyond = {
        "voltage_min": limits.voltage_min - low,
        "voltage_max": high - limits.voltage_max,
        "max_slew_rate": (slew - limits.max_slew_rate) * period,
    }
    limit = max(beyond, key=lambda name: beyond[name])
    if beyond[limit] <= 0.0 and without_amplifier_limits(model) is not model:
        limit = "amplifier"
    others = tuple(name for name in beyond if name != limit and beyond[name] > 0.0)
    return UnreachablePart(period * begin, period * end, largest, low, high, slew, limit, others)


def _at_the_lowest_voltage(model: Model, limits: Limits) -> tuple[float, float]:
    """Displacement of a stage settled at `voltage_min` [m], and the direction in which a higher voltage moves it (±1).

    Zeros without a `voltage_min`.
    """
    if not np.isfinite(limits.voltage_min):
        return 0.0, 0.0
    higher = min(limits.voltage_max, limits.voltage_min + model.voltage_scale)
    at, above = (float(model.run([u], model.rest(u))[0][0]) for u in (limits.voltage_min, higher))
    return at, float(np.sign(above - at))
