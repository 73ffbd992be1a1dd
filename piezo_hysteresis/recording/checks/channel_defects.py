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

"""Defects of one recorded phase: clipped, stuck, interrupted or coarse channels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...errors import counted
from ...record import Notice, Record, Samples
from .split_at_gaps import segments

FEWEST_LEVELS = 1000
"""Quantisation is reported where a channel uses fewer levels than this; it is severe below a sixteenth of it."""

_DRIVE_MOVES = 0.05
"""Share of the range by which the drive must move for a constant displacement to be a defect."""
_DRIVE_RETURNS = 0.01
"""The same at an extreme of the displacement, counted beyond both ends of the run."""
_DEAD_TIME = 100
"""Number of samples by which the displacement may follow the drive later, at most half of a constant displacement."""
_RETURN = 0.03
"""Share of the range by which the displacement must continue and return while the voltage is constant."""
_ARC = 0.9
"""Correlation with one arc from which the displacement shows a cut-off turning point."""
_MISSED = 0.3
"""Share of the movement that a cut-off turning point would cause, from which it is one."""
_PARTS = 32
"""Parts of a run that are averaged."""
_CONSTANT_SPEED = 0.75
"""Share of equal increments from which a drive consists of ramps."""
_SEVERE_SHARE = 0.05
"""Share of samples from which a defect spoils a phase."""
_SEVERE_CUT = 0.02
"""Share of the drive range beyond a clipped extreme from which it spoils a phase, however few its samples."""
_ALONE = 0.5
"""Largest movement of the displacement just before and after a drop-out, as a share of its jump."""
_BESIDE = 3
"""Number of samples before and after a drop-out in which the displacement moves little."""
_BEND = 2.5
"""Second differences of the displacement after a pulse of the voltage, over those before, up to which it stands still.
"""
_VISIBLE = 0.05
"""The same as a share of the movement that the pulse would cause at low frequency, so that noise does not hide it."""
_ROUGH_SHARE, _FEW = 0.001, 3
"""Share and number of samples up to which drop-outs do not spoil a phase."""


def channel_defects(record: Record) -> list[Notice]:
    """Notices ``clipped``, ``stuck``, ``dropout`` and ``quantisation`` about a phase in which the drive moves."""
    if record.size < 16:
        return []
    return [*_stuck(record), *_clipped_voltage(record), *_dropouts(record), *_quantised(record)]


def _runs_of_equal(values: Samples, shortest: int) -> NDArray[np.int64]:
    """Start and stop of every run of at least `shortest` equal samples, shape (k, 2)."""
    same = np.diff(values) == 0.0
    runs = np.array(segments(same), np.int64).reshape(-1, 2)
    runs[:, 1] += 1
    return np.asarray(runs[runs[:, 1] - runs[:, 0] >= shortest])


def _extremes(values: Samples, runs: NDArray[np.int64]) -> tuple[Samples, Samples]:
    """Lowest and highest value in every run."""
    padded = np.append(values, values[-1])  # a run may end after the last sample
    return np.minimum.reduceat(padded, runs.ravel())[::2], np.maximum.reduceat(padded, runs.ravel())[::2]


def _stuck(record: Record) -> list[Notice]:
    """Displacement that is constant while the drive moves: clipped at its extremes, stuck elsewhere."""
    y, u = record.displacement, record.voltage
    runs = _runs_of_equal(y, 5)
    if not len(runs):
        return []
    at_rail = np.isin(y[runs[:, 0]], (y.min(), y.max()))
    low, high = _extremes(u, runs)
    first, last = u[runs[:, 0]], u[runs[:, 1] - 1]
    before = runs.copy()  # a stage at rest stays where it is during the dead time after a step
    before[:, 1] -= np.minimum(np.diff(runs).ravel() // 2, _DEAD_TIME)
    moves = np.ptp(_extremes(u, before), axis=0)
    beyond = np.maximum(high - np.maximum(first, last), np.minimum(first, last) - low)
    # with backlash a stage also stands still after a turning point of the drive, but not across it
    moved = (moves > _DRIVE_MOVES * np.ptp(u)) | (at_rail & (beyond > _DRIVE_RETURNS * np.ptp(u)))
    runs, at_rail, beyond = runs[moved], at_rail[moved], beyond[moved]
    cut = bool(beyond[at_rail].max(initial=0.0) > _SEVERE_CUT * np.ptp(u))
    notices = []
    for kind, part, text, spoils in (
        ("clipped", runs[at_rail], "the displacement is clipped at {:.4g} m", cut),
        ("stuck", runs[~at_rail], "the displacement stays at {:.4g} m", False),
    ):
        if len(part):
            samples = int((part[:, 1] - part[:, 0]).sum())
            message = text.format(float(y[part[0, 0]])) + f" for {counted(samples, 'sample')} while the drive moves"
            severe = spoils or samples > _SEVERE_SHARE * record.size
            notices.append(Notice(kind, message, record.phase, severe=severe))
    return notices


def _clipped_voltage(record: Record) -> list[Notice]:
    """Voltage that is constant at its extreme while the displacement continues and returns: it is clipped."""
    y, u = record.displacement, record.voltage
    samples = 0
    direction = np.sign(np.dot(u - u.mean(), y - y.mean()) or 1.0)
    returned = _RETURN * float(np.ptp(y))
    gain = float(np.ptp(y)) / max(float(np.ptp(u)), 1e-300)
    for rail, sign in ((u.max(), 1.0), (u.min(), -1.0)):
        runs = _runs_of_equal(np.where(u == rail, rail, np.arange(u.size)), 5)
        for a, b in runs.tolist():
            way = sign * direction * _means(y[a:b])
            rise = way - np.linspace(way[0], way[-1], way.size)
            # a stage that rings after a step also goes on and comes back, but ends far from where it was, or swings
            # about its level; a turning point that is not in the recording gives one arc over the whole run
            returns = way.max() - max(way[0], way[-1]) > max(returned, abs(way[0] - way[-1]))
            arc = np.sin(np.linspace(0.0, np.pi, way.size))
            likeness = float(rise @ arc) / max(float(np.sqrt((rise @ rise) * (arc @ arc))), 1e-300)
            if returns and likeness > _ARC and rise.max() > _MISSED * gain * _taken_off(u, a, b):
                samples += b - a
    if not samples:
        return []
    text = f"the voltage is clipped for {samples} samples while the displacement continues"
    return [Notice("clipped", text, record.phase, severe=samples > _SEVERE_SHARE * record.size)]


def _means(values: Samples) -> Samples:
    """Means of at most `_PARTS` equal parts, which distinguish an arc from noise."""
    starts = np.unique(np.linspace(0, values.size, min(_PARTS, values.size), endpoint=False).astype(np.int64))
    return np.asarray(np.add.reduceat(values, starts) / np.diff(starts, append=values.size))


def _taken_off(voltage: Samples, start: int, stop: int) -> float:
    """Height of the parabola that leaves and meets the voltage around a run at the steeper of its two slopes."""
    around = voltage[max(0, start - 2) : start + 1], voltage[stop - 1 : stop + 2]
    slope = max(float(np.abs(np.diff(part)).max(initial=0.0)) for part in around)
    return slope * (stop - start) / 4.0


def _dropouts(record: Record) -> list[Notice]:
    """A channel that jumps away and back within a few samples while the other one does not move so."""
    y, u = record.displacement, record.voltage
    notices = []
    for name, values, is_smooth in (
        ("displacement", y, lambda a, b: bool(np.ptp(u[max(0, a - 20) : b + 20]) < 0.25 * np.ptp(u))),
        ("voltage", u, lambda a, b: _does_not_follow(record, a, b)),
    ):
        lengths = _jumps_and_back(values, is_smooth)
        if lengths:
            ending = "" if values is y else ", and the displacement does not follow"
            text = f"the {name} drops out {len(lengths)} times, {sum(lengths)} samples in all{ending}"
            severe = sum(lengths) > max(_FEW, _ROUGH_SHARE * record.size)
            notices.append(Notice("dropout", text, record.phase, severe=severe))
    return notices


def _jumps_and_back(values: Samples, is_smooth: Callable[[int, int], bool]) -> list[int]:
    """Lengths of the jumps away and back; the other channel `is_smooth` around them."""
    longest = max(1, min(1000, values.size // 100))
    steps = np.diff(values)
    least = max(0.1 * float(np.ptp(values)), 8.0 * float(np.quantile(np.abs(steps), 0.99)))
    large = np.flatnonzero(np.abs(steps) > least)
    lengths = []
    k = 0
    while k + 1 < large.size:
        a, b = int(large[k]), int(large[k + 1])
        back = abs(values[b + 1] - values[a]) < 0.25 * abs(steps[a])
        # a stage that rings after a step moves as fast before and after
        beside = np.concatenate((steps[max(0, a - _BESIDE) : a], steps[b + 1 : b + 1 + _BESIDE]))
        alone = float(np.abs(beside).max(initial=0.0)) < _ALONE * abs(steps[a])
        if back and alone and steps[a] * steps[b] < 0 and b - a <= longest and is_smooth(a, b):
            lengths.append(b - a)
            k += 2
        else:
            k += 1
    return lengths


def _does_not_follow(record: Record, start: int, stop: int) -> bool:
    """Whether the displacement would show a pulse of the voltage, however weakly, and does not."""
    y, u = record.displacement, record.voltage
    expected = float(np.ptp(y)) / float(np.ptp(u)) * abs(float(u[start + 1] - u[start]))
    bends = np.abs(np.diff(y, 2))
    before = bends[max(0, start - _DEAD_TIME) : max(0, start - 1)].max(initial=0.0)
    after = bends[max(0, start - 1) : stop + _DEAD_TIME].max(initial=0.0)
    return bool(after < _BEND * max(before, float(np.median(bends))) and after < _VISIBLE * expected)


def _ramps(values: Samples) -> bool:
    """Whether a drive consists of ramps: most moving samples repeat the increment before; rounding makes exceptions."""
    moves = np.diff(values[:200_000])
    goes_on = np.abs(np.diff(moves)) < 1e-6 * np.abs(moves).max(initial=0.0)
    return bool(goes_on[moves[1:] != 0.0].mean() > _CONSTANT_SPEED)


def _quantised(record: Record) -> list[Notice]:
    """Channels whose values lie on few levels."""
    notices = []
    for name, unit, values in (("voltage", "V", record.voltage), ("displacement", "m", record.displacement)):
        levels = np.unique(values[:200_000])
        if levels.size < 3 or (name == "voltage" and (levels.size < 16 or _ramps(values))):
            continue  # a drive of steps has few levels, one of ramps has equal increments
        gaps = np.diff(levels)
        step = float(gaps[gaps > 1e-9 * np.ptp(values)].min(initial=np.inf))
        count = float(np.ptp(values)) / step
        on_grid = np.abs(gaps / step - np.rint(gaps / step)).max() < 0.05
        if count < FEWEST_LEVELS and on_grid and values[:200_000].size > 2 * levels.size:
            text = f"the {name} is quantised in steps of {step:.3g} {unit}: {count:.0f} levels in its range"
            notices.append(Notice("quantisation", text, record.phase, severe=count < FEWEST_LEVELS / 16))
    return notices
