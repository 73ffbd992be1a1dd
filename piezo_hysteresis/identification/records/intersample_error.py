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

"""Inter-sample error: in a slow record, whose samples are averages, the drive may jump or turn between two samples.

Linear interpolation between averages cuts off the peaks of the drive. Without a correction the model would be judged by
an error of the recorder.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...blocks.block import Array
from ...effects import Arx
from ...model.model import Model
from ...record import Record

PARTS = 16
"""Largest number of parts into which a sample is divided."""
SMOOTHER = 0.97
"""Largest share of the squared second differences, or of the square, of a residual that a correction may leave."""
KINKED = 3.0
"""Ratio of a second difference of the drive to those three samples before and after from which it is a kink."""
TINY = 1e-12
"""Share of the drive range below which the drive counts as constant, and shortest ramp as a share of a sample."""
ITS_SIZE = (0.7, 1.3)
"""Range of the fitted factor of a correction that explains the residual (ideal: 1)."""
SMALL = 0.1
"""Largest share of the response of a relaxation that counts as creep; that of a slow amplifier is larger."""
REAL = 1e-9
"""Imaginary part below which a root is real."""


def intersample_error(model: Model, records: Sequence[Record]) -> list[Array]:
    """Correction of the simulation for slow drives that turn within a sample, if samples are averages [m].

    Averages do not show whether a drive ramped or jumped to the next level. The displacement decides this for every
    record, because a wrong choice gives large residuals in single samples. A slow record also does not show the ringing
    after a turn. No correction is made if it does not stand out in single samples and the residual does not contain it
    in the right size, because it may then result from inaccurate dynamics. Relaxations that are slower than one sample
    are visible in the samples, and are left out of G.

    Parameters
    ----------
    model : Model
        Model with the present hysteresis and dynamics.
    records : sequence of Record
        Records in order.

    Returns
    -------
    list of (n,) ndarray
        Correction by record; zero if the record is not slow or needs none.
    """
    most = [min(PARTS, 2 * int(0.5005 * r.sample_period / model.sample_period)) for r in records]
    parts = [n if n > 1 and _turns_sharply(r) else 1 for r, n in zip(records, most, strict=True)]
    coarse = [r.sample_period for r, n in zip(records, parts, strict=True) if n > 1]
    if not coarse:
        return [np.zeros(r.size) for r in records]
    model = quick_dynamics(model, min(coarse))
    straight = model.free_run(records)
    changes = []
    for abrupt in (False, True):
        sharp = [_sharpened(r, n, abrupt) if n > 1 else r for r, n in zip(records, parts, strict=True)]
        pairs = zip(straight, model.free_run(sharp), strict=True)
        changes.append([y.reshape(x.size, -1).mean(axis=1) - x for x, y in pairs])
    off = [r.displacement - y for r, y in zip(records, straight, strict=True)]
    return [chosen_correction(e, a, b) for e, a, b in zip(off, *changes, strict=True)]


def quick_dynamics(model: Model, longest: float) -> Model:
    """The model without relaxations of G slower than `longest` [s], with the same dc gain.

    In a fit without creep, G gets poles at a few hertz, each close to a zero. They imitate creep in fast records. In
    slow records G is a gain and a delay, so these poles have no influence. Without `arx` the model is unchanged.
    """
    if Arx.name not in model:
        return model
    arx = model[Arx.name]
    a, b = np.append(1.0, arx.array("a")), arx.array("b")
    poles, zeros = np.roots(a), np.roots(b)
    slow = [p.real for p in poles if abs(p.imag) < REAL and np.exp(-model.sample_period / longest) < p.real < 1.0]
    removed = 0
    for pole in sorted(slow, reverse=True):
        beside = [k for k, q in enumerate(zeros) if abs(q.imag) < REAL and _share(pole, q.real) < SMALL]
        if beside:
            zeros = np.delete(zeros, min(beside, key=lambda k: abs(zeros[k] - pole)))
            poles = np.delete(poles, np.argmin(np.abs(poles - pole)))
            removed += 1
    if not removed or b.sum() == 0.0:
        return model
    unused = np.zeros(removed)
    lean_a, lean_b = np.append(np.poly(poles).real, unused), np.append(np.poly(zeros).real, unused)
    lean_b = np.append(np.zeros(b.size - lean_b.size), lean_b)  # leading zeros of b are a delay
    lean_b *= b.sum() / a.sum() * lean_a.sum() / lean_b.sum()
    return model.with_effect(arx.with_values(a=tuple(lean_a[1:].tolist()), b=tuple(lean_b.tolist())))


def _share(pole: float, zero: float) -> float:
    """Delayed share of the final response of (1 − zero z⁻¹)/(1 − pole z⁻¹)."""
    return abs(1.0 - (1.0 - pole) / (1.0 - zero)) if zero != 1.0 else np.inf


def chosen_correction(residual: Array, gradual: Array, abrupt: Array) -> Array:
    """The correction that leaves the smoother and smaller residual; zero if neither improves it much; shape (n,) [m].

    The corrections are for a drive that ramps (`gradual`) and for one that jumps (`abrupt`) within a sample.
    """
    change = min((gradual, abrupt), key=lambda c: _unevenness(residual - c) * np.var(residual - c))
    smoother = _unevenness(residual - change) < SMOOTHER * _unevenness(residual)
    return change if smoother or _holds(residual, change) else np.zeros_like(change)


def _holds(residual: Array, change: Array) -> bool:
    """Whether the residual contains the correction in its size, and is much smaller without it."""
    residual, change = residual - residual.mean(), change - change.mean()
    power, size = float(residual @ residual), float(change @ change)
    if size == 0.0:
        return False
    left = residual - change
    return bool(ITS_SIZE[0] < residual @ change / size < ITS_SIZE[1] and left @ left < SMOOTHER * power)


def _turns_sharply(record: Record) -> bool:
    """Whether the drive has kinks. For a smooth drive, a difference between two rates comes from the dynamics."""
    before = [float(record.voltage[0]) if record.continues else record.settled_voltage] * 5
    bends = np.abs(np.diff(np.concatenate((before, record.voltage, record.voltage[-1:].repeat(3))), 2))
    around = np.maximum(bends[:-6], bends[6:])
    return bool(np.any((bends[3:-3] > KINKED * around) & (bends[3:-3] > 0.5 * bends.max())))


def _unevenness(residual: Array) -> float:
    return float(np.sum(np.diff(residual, 2) ** 2))


def _sharpened(record: Record, parts: int, abrupt: bool) -> Record:
    return record.with_channels(
        lambda channel: np.repeat(channel, parts),
        voltage=sharp_drive(record.voltage, record.settled_voltage, parts, abrupt=abrupt),
        sample_period=record.sample_period / parts,
        initial_voltage=None if record.continues else record.settled_voltage,
    )


def sharp_drive(averages: Array, before: float, parts: int, *, abrupt: bool = False) -> Array:
    """A drive with the given averages that turns, ramps or jumps within a sample.

    Parameters
    ----------
    averages : (n,) ndarray
        Average of the drive over every sample [V].
    before : float
        Drive before the first sample [V].
    parts : int
        Number of values per sample, an even number.
    abrupt : bool
        Whether the drive jumps where it continues in one direction.

    Returns
    -------
    (n parts,) ndarray
        The drive [V], averaged over every part. In each sample it goes from its start through its middle to its end;
        where it would overshoot, it is constant before or after a straight ramp.

    Examples
    --------
    >>> sharp_drive(np.array([0.0, 0.0, 0.0, 2.0, 4.0, 4.0, 4.0]), 0.0, 4)[12:16].tolist()  # a ramp
    [0.5, 1.5, 2.5, 3.5]
    >>> sharp_drive(np.array([0.0, 0.0, 0.0, 3.5, 4.0, 4.0, 4.0]), 0.0, 4)[12:16].tolist()  # the end of a ramp
    [2.0, 4.0, 4.0, 4.0]
    >>> sharp_drive(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 4.0, 4.0]), 0.0, 4, abrupt=True)[12:16].round(6)  # a jump
    array([0., 4., 4., 4.])
    >>> sharp_drive(np.array([0.0, 1.0, 2.0, 2.75, 2.0, 1.0, 0.0]), 0.0, 4)[12:16].tolist()  # a turn at 3 V
    [2.625, 2.875, 2.875, 2.625]
    """
    borders = _borders(np.concatenate(([before] * 3, averages, [averages[-1]] * 3)))
    start, end = borders[:-1, None], borders[1:, None]
    middle = averages[:, None]
    peak = 2.0 * middle - 0.5 * (start + end)
    at = (np.arange(parts) + 0.5) / parts
    bent = np.where(at < 0.5, start + 2.0 * at * (peak - start), peak + (2.0 * at - 1.0) * (end - peak))
    height = end - start
    rises = np.abs(height) > TINY * np.abs(averages).max(initial=0.0)
    early = np.divide(end - middle, height, out=np.full_like(height, 0.5), where=rises)
    share = np.maximum(0.0 if abrupt else 2.0 * np.minimum(early, 1.0 - early), TINY)
    since = np.arange(parts + 1) / parts - (early - 0.5 * share)
    covered = 0.5 * share * np.clip(since / share, 0.0, 1.0) ** 2 + np.maximum(since - share, 0.0)
    straight = start + height * parts * np.diff(covered, axis=1)
    overshoots = abrupt | ((peak - start) * (end - peak) < 0.0)
    goes_on = (middle - start) * (end - middle) >= 0.0
    return np.ravel(np.where(overshoots & goes_on, straight, bent))


def _borders(v: Array) -> Array:
    """Drive at the borders between padded averages: on the straightest line from the left, the right or between."""
    a, b, c, d, e, f = (v[k : v.size - 5 + k] for k in range(6))
    lines = np.array([c + 0.5 * (c - b), 0.5 * (c + d), d - 0.5 * (e - d)])
    bends = np.abs([a - 2.0 * b + c, b - c - d + e, d - 2.0 * e + f])
    return np.asarray(np.take_along_axis(lines, np.argmin(bends, axis=0)[None], axis=0)[0])
