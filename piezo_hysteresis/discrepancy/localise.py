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

"""Where simulation and measurement disagree: shares of the residual along the axes that distinguish effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Array
from ..identification.free_run_error import free_per_record, residuals_on
from ..model.model import Model
from ..record import Record

Bins = NDArray[np.intp]

FREQUENCIES = np.array([0.0, 0.5, 5.0, 25.0, 75.0, 150.0, 250.0, 350.0, 600.0, 1.2e3, 2.5e3, np.inf])
"""Edges of the bins of frequency [Hz]."""
REST_TIMES = np.concatenate(([0.0], np.geomspace(1e-4, 100.0, 13), [np.inf]))
"""Edges of the bins of time since the last change of level [s]."""
TENTHS = [f"{10 * k} to {10 * k + 10} % of the drive range" for k in range(10)]
"""Bins of a voltage."""


@dataclass(frozen=True, slots=True)
class ResidualShare:
    """Distribution of the residual along one axis.

    Parameters
    ----------
    axis : str
        ``phase``, ``frequency``, ``amplitude``, ``direction``, ``turning_point_distance``,
        ``time_since_level_change`` or ``absolute_time``.
    share : float
        Share of the residual power in the bins of `detail`, 0 to 1.
    detail : str
        The bins with the largest shares, as text.
    bins : tuple of (str, float)
        Share of every bin; they add up to 1.
    """

    axis: str
    share: float
    detail: str
    bins: tuple[tuple[str, float], ...]


def located(
    model: Model, records: Sequence[Record], used: Sequence[int], floors: Sequence[float] | Array, offset: bool = False
) -> tuple[ResidualShare, ...]:
    """Shares of the residual of a model on the records `used`, along every axis.

    The `floors` [m] are those of all records. With `offset`, the sensor zero is free in every record.

    Records that are neither used nor continued by one are not simulated. A model that diverges on one raises a
    DivergenceError.
    """
    left = residuals_on(model, records, used, free_per_record(model, offset=offset))
    return localise([records[i] for i in used], left, [floors[i] for i in used])


def localise(
    records: Sequence[Record], residuals: Sequence[Array], floors: Sequence[float]
) -> tuple[ResidualShare, ...]:
    """Shares of the residual along every axis, the axis with the largest share first.

    Parameters
    ----------
    records : sequence of Record
        In experiment order; the drive range is that of all of them.
    residuals : sequence of (n,) ndarray
        Measured minus simulated displacement [m].
    floors : sequence of float
        Floor of every record [m], the unit of the residual; every record has the same weight.

    Returns
    -------
    tuple of ResidualShare
        Ordered by concentration of the residual in comparison with evenly distributed power.
    """
    power = [e * e / (f * f * e.size) for e, f in zip(residuals, floors, strict=True)]
    if not any(p.any() for p in power):
        return ()
    spectra = [_one_sided(e) / (f * f) for e, f in zip(residuals, floors, strict=True)]
    lines = [np.searchsorted(FREQUENCIES, np.fft.rfftfreq(r.size, r.sample_period), side="right") - 1 for r in records]
    phases = list(dict.fromkeys(r.phase for r in records))
    end = max(r.start_time + r.duration for r in records)
    lowest = min(float(r.voltage.min()) for r in records)
    span = max(float(r.voltage.max()) for r in records) - lowest
    samples = [_sample_bins(r, lowest, span, end) for r in records]
    labels = {
        "amplitude": TENTHS,
        "direction": ["falling drive", "drive at rest", "rising drive"],
        "turning_point_distance": [f"{tenth} after a turning point" for tenth in TENTHS],
        "time_since_level_change": [f"{time} after a change of level" for time in _ranges(REST_TIMES, ".2g", "s")],
        "absolute_time": [f"{k * end / 10:.3g} to {(k + 1) * end / 10:.3g} s" for k in range(10)],
    }
    axes = {
        "phase": (phases, [np.array([phases.index(r.phase)]) for r in records], [p.sum(keepdims=True) for p in power]),
        "frequency": (_ranges(FREQUENCIES, "g", "Hz"), lines, spectra),
        **{axis: (names, [bins[axis] for bins in samples], power) for axis, names in labels.items()},
    }
    places = [_place(axis, *along) for axis, along in axes.items()]
    return tuple(place for place, _ in sorted(places, key=lambda found: -found[1]))


def _one_sided(e: Array) -> Array:
    """Power of e at the frequencies from dc to Nyquist, whose sum is its mean square; all others stand for two."""
    power = np.abs(np.fft.rfft(e) / e.size) ** 2
    power[1 : (e.size + 1) // 2] *= 2.0
    return power


def _place(
    axis: str, labels: Sequence[str], bins: Sequence[Bins], power: Sequence[Array]
) -> tuple[ResidualShare, float]:
    """Shares along one axis, and their concentration: the difference between the shares of power and of samples."""
    held, room = np.zeros((2, len(labels)))
    for index, p in zip(bins, power, strict=True):
        known = index >= 0
        held += np.bincount(index[known], p[known], len(labels))
        room += np.bincount(index[known], minlength=len(labels)) / p.size
    shares = held / max(held.sum(), 1e-300)
    excess = shares - room / max(room.sum(), 1e-300)
    chosen = [k for k in np.argsort(-excess) if excess[k] > 0.25 * max(excess.max(), 1e-12)][:3]
    message = ", ".join(f"{labels[k]} ({100 * shares[k]:.0f} %)" for k in chosen)
    bars = tuple(zip(labels, shares.tolist(), strict=True))
    return ResidualShare(axis, float(shares[chosen].sum()), message, bars), float(np.abs(excess).sum() / 2.0)


def _ranges(edges: Array, form: str, unit: str) -> list[str]:
    """The bins between edges, as text."""
    pairs = zip(edges, edges[1:], strict=False)
    return [f"{a:{form}} {unit} or more" if np.isinf(b) else f"{a:{form}} to {b:{form}} {unit}" for a, b in pairs]


def _sample_bins(record: Record, lowest: float, span: float, end: float) -> dict[str, Bins]:
    """The bin of every sample along the axes of drive and time; −1 for a sample in none of them."""
    u = record.voltage
    scale = max(span, 1e-300)
    steps = np.diff(u, prepend=record.settled_voltage)
    moving = np.abs(steps) > 1e-6 * scale
    sign = np.where(moving, np.sign(steps), 0.0)
    # direction of the last motion, also during rests
    last_move = np.maximum.accumulate(np.where(moving, np.arange(u.size), -1))
    going = np.where(last_move >= 0, sign[np.maximum(last_move, 0)], 0.0)
    turned = np.diff(going, prepend=going[0]) != 0
    turn = np.maximum.accumulate(np.where(turned, np.arange(u.size), 0))
    rests = ~moving & (last_move >= 0)
    times = np.searchsorted(REST_TIMES, (np.arange(u.size) - last_move) * record.sample_period, side="right") - 1
    return {
        "amplitude": np.clip((10 * (u - lowest) / scale).astype(int), 0, 9),
        "direction": (sign + 1).astype(int),
        "turning_point_distance": np.clip((10 * np.abs(u - u[turn]) / scale).astype(int), 0, 9),
        "time_since_level_change": np.where(rests, np.minimum(times, REST_TIMES.size - 2), -1),
        "absolute_time": np.minimum((10 * record.time / end).astype(int), 9),
    }
