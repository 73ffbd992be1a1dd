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

"""Checks of the beginning of phases: whether their first samples agree with a settled stage, and with one another."""

from __future__ import annotations

import numpy as np

from ...record import Experiment, Notice, Record, Samples
from ..segmentation.swing_shapes import turning_points

_OPENING = 0.1
"""Share of the range of the drive up to which it counts as hardly moved."""
_EXCERPT = 1 << 20
"""Number of samples that are examined."""
_SWING = 0.02
"""Least swing of a turning point, share of the range."""
_INSIDE = 0.1
"""Distance from the turning points at which a record must begin, share of the range."""
_SAME = 0.02
"""Largest difference of two periods, share of the range."""
_ON_BRANCH = 0.2
"""Distance from a branch up to which a record begins on it, share of the width of the loop."""
_NOISE = 8.0
"""Noise widths that a movement must exceed."""
_FIRST = 8
"""Samples of the first movement."""
_SAME_VOLTAGE = 1e-3
"""Largest difference of two equal voltages, share of the range."""
_APART = 0.01
"""Least difference of two displacements, share of the stroke."""
_STRAIGHT, _NEAR = 0.1, 0.05
"""Largest relative change of the step of a ramp; tolerance of its first sample, in steps."""
_JUMP = 0.05
"""Least jump of the displacement behind a step that is not recorded, share of the range."""
_STILL, _FEWEST_HELD = 1e-3, 32
"""Range of a drive that is held, share of the range of the experiment; smallest number of samples of it."""
_NEAR_LEVEL = 0.25
"""Distance to a level from which such a step may have come, share of the step."""
_AHEAD = (0.5, 1.0)
"""Samples from where a ramp begins to its first sample: for averages half of one, or a little more."""


def is_within_its_loop(record: Record) -> bool:
    """True where a periodic record begins in motion, with the displacement that it has a period later.

    A stage that had settled at the first voltage begins between the branches of its loop, and a little after the drive.
    A stage that was cycling before begins on a branch, in motion. At the end of a swing both are the same; the stage is
    then assumed to have settled.
    """
    if record.continues or record.truncated or record.initial_voltage is not None or record.size < 64:
        return False
    u, y = record.voltage[:_EXCERPT], record.displacement[:_EXCERPT]
    span = float(np.ptp(u))
    turns = turning_points(u, _SWING * span) if span > 0.0 else np.empty(0, np.int64)
    if turns.size < 5:
        return False
    first, second, third = (int(t) for t in turns[1:4])
    period, opening = third - first, max(2, first // 20)
    inside = min(abs(u[0] - u[first]), abs(u[0] - u[second])) > _INSIDE * span
    if first < 8 or first > period or not inside or abs(u[opening] - u[0]) < 0.02 * abs(u[first] - u[0]):
        return False
    if np.abs(u[:first] - u[period : period + first]).max() > _SAME * span:
        return False
    back = first + int(np.argmin(np.abs(u[first:second] - u[0])))
    width = abs(float(y[back] - y[period]))
    noise = float(np.median(np.abs(np.diff(y, 3)))) / 3.0
    off = abs(float(np.mean(y[:opening] - y[period : period + opening])))
    few = min(opening, _FIRST)
    moves, later = float(y[few] - y[0]), float(y[period + few] - y[period])
    starts = abs(moves - later) > 0.5 * abs(later) > 3.0 * noise
    return bool(width > 10.0 * noise and off < _ON_BRANCH * width and not starts)


def not_at_rest(record: Record) -> list[Notice]:
    """Notice ``not_at_rest`` where the displacement moves at the start although the drive hardly does.

    A record that continues another one, or whose beginning is missing, need not begin at rest and is not checked. A
    record whose drive leaves its settled voltage with the first sample is not checked either, because the stage then
    has to move.
    """
    if record.continues or record.truncated or record.size < 20:
        return []
    u, y = record.voltage, record.displacement
    u_span, y_span = float(np.ptp(u)), float(np.ptp(y))
    if y_span == 0.0 or abs(u[0] - record.settled_voltage) > 0.02 * max(u_span, abs(record.settled_voltage)):
        return []
    moved = np.flatnonzero(np.abs(u - u[0]) > _OPENING * u_span) if u_span > 0.0 else np.array([], int)
    opening = int(moved[0]) if moved.size else record.size
    if opening < 4:
        return []
    opening = min(opening, max(20, record.size // 20))
    noise = _noise(y)
    few = max(1, opening // 8)
    later = float(y[opening - few : opening].mean())
    first = float(y[0]) if abs(later - y[0]) > _JUMP * y_span else float(y[:few].mean())
    drift = abs(later - first)
    explained = 3.0 * float(np.abs(u[:opening] - u[0]).max()) * (y_span / u_span if u_span > 0.0 else 0.0)
    # creep and drift also move a resting stage: only a movement that is large against the phase counts
    if drift <= explained + _NOISE * noise / np.sqrt(few) + (0.05 * y_span if u_span > 0.0 else np.inf):
        return []
    text = (
        f"the displacement moves by {drift:.3g} m in the first {opening} samples, the drive by "
        f"{float(np.abs(u[:opening] - u[0]).max()):.3g} V; the stage had not settled at "
        f"{record.settled_voltage:.4g} V; "
        "give `initial_voltage`"
    )
    return [Notice("not_at_rest", text, record.phase)]


def _noise(displacement: Samples) -> float:
    return float(np.median(np.abs(np.diff(displacement, 2)))) / 2.4


def steps_from(experiment: Experiment) -> dict[int, float]:
    """Records whose displacement jumps while the drive is held from the first sample, with the level [V] before.

    The stage follows a step that the record does not show. The jump and the gain of the stage give the level; it has to
    be near 0 V, or near a level at which other records rest when they begin.
    """
    found: dict[int, float] = {}
    driven = max(experiment, key=lambda r: float(np.ptp(r.voltage)))
    begins = _held(driven, float(np.ptp(driven.voltage)))
    moving = driven[begins if begins < driven.size else 0 :]
    u_span, y_span = float(np.ptp(moving.voltage)), float(np.ptp(moving.displacement))
    if u_span == 0.0 or y_span == 0.0:
        return found
    along = np.dot(moving.voltage - moving.voltage.mean(), moving.displacement)
    gain = float(np.sign(along)) * y_span / u_span
    for i, record in enumerate(experiment):
        if record.continues or record.truncated or record.initial_voltage is not None:
            continue
        u, y = record.voltage[:_EXCERPT], record.displacement[:_EXCERPT]
        held = _held(record, u_span)
        if held < _FEWEST_HELD:
            continue
        jump = float(np.median(y[held // 2 : held])) - float(y[0])
        if abs(jump) < _JUMP * y_span + _NOISE * _noise(y):
            continue
        level = float(u[0]) - jump / gain
        others = [r.settled_voltage for k, r in enumerate(experiment) if k != i and r.initial_voltage is not None]
        nearest = min((0.0, *others), key=lambda v: abs(v - level))
        if abs(nearest - level) < _NEAR_LEVEL * abs(jump / gain):
            found[i] = nearest
    return found


def _held(record: Record, span: float) -> int:
    """Number of first samples in which the drive is held; `span` is the range of the drive [V]."""
    u = record.voltage[:_EXCERPT]
    moved = np.flatnonzero(np.abs(u - u[0]) > _STILL * span)
    return int(moved[0]) if moved.size else u.size


def departures(experiment: Experiment) -> dict[int, float]:
    """Records that begin in motion, with the level [V] from which their first samples come.

    If the first stored sample lies on a ramp from rest, or is an average over its beginning, the record begins beside
    the level of the rest. Levels are 0 V and those at which other records rest when they begin.
    """
    begins_at_rest = (r for r in experiment if r.size > 1 and not r.continues and r.voltage[1] == r.voltage[0])
    levels, found = {r.settled_voltage for r in begins_at_rest}, dict[int, float]()
    for i, record in enumerate(experiment):
        if record.continues or record.truncated or record.initial_voltage is not None or record.size < 3:
            continue
        first, step = float(record.voltage[0]), float(record.voltage[1] - record.voltage[0])
        if abs(float(record.voltage[2] - record.voltage[1]) - step) >= _STRAIGHT * abs(step):
            continue
        for level in (*sorted(levels, key=lambda v: abs(v - first)), 0.0):
            if _AHEAD[0] - _NEAR < (first - level) / step < _AHEAD[1] + _NEAR:
                found[i] = level
                break
    return found


def origins(experiment: Experiment) -> list[Notice]:
    """Notice ``origins_differ`` where two records begin at rest at one voltage, but not at one displacement."""
    records = [r for r in experiment if not (r.continues or r.truncated) and r.size >= 20]
    span = float(np.ptp([(r.voltage.max(), r.voltage.min()) for r in records] or 0.0))
    stroke = max((float(np.ptp(r.displacement)) for r in records), default=0.0)
    settled = [r for r in records if abs(r.voltage[0] - r.settled_voltage) <= _SAME_VOLTAGE * span]
    for i, record in enumerate(settled):
        alike = [r for r in settled[:i] if abs(r.voltage[0] - record.voltage[0]) <= _SAME_VOLTAGE * span]
        if not alike:
            continue
        apart = abs(float(record.displacement[0] - alike[0].displacement[0]))
        # estimating the noise of a long record is slow, and most records begin alike
        if apart > _APART * stroke and all(apart > _NOISE * _noise(r.displacement) for r in (record, alike[0])):
            text = (
                f"begins at {record.voltage[0]:.4g} V as {alike[0].phase} does, but {apart:.3g} m "
                "away: the sensor zero was "
                "changed, the stage had not settled, or it drifted; the model has one zero and starts from rest"
            )
            return [Notice("origins_differ", text, record.phase)]
    return []
