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

"""How a stage rings after a step or a sharp turn, from the residual without a mode: its frequency, or its decay."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ...effects import AmplifierSlewLimitHeld, ExtraResonance
from ...model.model import Model
from ...record import Record
from .pieces import STILL, Kind, RecordPiece

Array = NDArray[np.float64]

CYCLES = 4.0
"""Smallest number of cycles after a step or a turn."""
RESOLVED = 0.45
"""Highest frequency [cycles per sample]; a faster mode acts as a lag."""
SLOWEST = next(p.lower for p in ExtraResonance.parameters if p.name == "f0")
"""Lowest frequency of a mode [Hz]."""
ECHO = 40
"""Number of samples after a step from which the decay is estimated."""
FEWEST = 12
"""Smallest number of such samples."""
FORCED = 3
"""Number of samples after a step that depend on the delay and on the zeros, too, and not on the poles alone."""
LONGEST = 0.98
"""Largest radius of the poles of a decay; a longer one is the work of a mode that the samples show, or creep."""
SAME_LINE = 1.25
"""Ratio of two frequencies up to which they are one line."""
LINES = 3
"""Largest number of lines."""
SHARP = 10.0
"""Ratio of a second difference of the drive to the median one from which the drive turns sharply; 1.4 in a sine."""
STRAIGHT = 0.01
"""Largest deviation of the drive from a straight line between two sharp turns, as a share of the largest drive."""
STANDS_OUT = 10.0
"""Smallest ratio of the highest spectral line to the median of the spectrum, in power."""


def ringing_lines(model: Model, pieces: Sequence[RecordPiece]) -> list[tuple[float, Kind]]:
    """The highest spectral lines of the residual after steps and sharp turns, the highest first.

    After a sharp turn only drives that go on straight are used, because the misfit of the loop on a sine has harmonics.
    Behind slow turns this misfit is higher than the ringing behind fast ones, so that one line is not enough.

    Parameters
    ----------
    model : Model
        Model without a mode.
    pieces : sequence of RecordPiece
        Pieces in order.

    Returns
    -------
    list of (float, Kind)
        Frequency of every line [Hz], and the kind of the piece that shows it.
    """
    lines: list[tuple[float, float, Kind]] = []
    for kind, record, echoes in _echoes(model, pieces, (Kind.STEP, Kind.LOOP), 4 * CYCLES):
        longest = max(e.size for e in echoes)
        size = 8 * longest
        frequency = np.fft.rfftfreq(size, record.sample_period)
        power = np.zeros(frequency.size)
        for e in echoes:
            t = np.linspace(-1.0, 1.0, e.size)
            power += np.abs(np.fft.rfft(e - np.polynomial.Polynomial.fit(t, e, 2)(t), size)) ** 2
        low = max(CYCLES / (longest * record.sample_period), SLOWEST)
        band = (frequency > low) & (frequency < RESOLVED / record.sample_period)
        if not band.any():
            continue
        top = int(np.argmax(np.where(band, power, 0.0)))
        height = float(power[top] / np.median(power[band]))
        if height > STANDS_OUT:
            lines.append((height, float(frequency[top]), kind))
    found: list[tuple[float, Kind]] = []
    for _, line, kind in sorted(lines, key=lambda one: -one[0]):
        if all(max(line / other, other / line) > SAME_LINE for other, _ in found):
            found.append((line, kind))
    return found[:LINES]


def _echoes(
    model: Model, pieces: Sequence[RecordPiece], kinds: Collection[Kind], fewest: float
) -> list[tuple[Kind, Record, list[Array]]]:
    """Kind, record and residuals after a step, or between sharp turns, of every piece of `kinds` that has any.

    Residuals of fewer than `fewest` samples are left out.
    """
    found: list[tuple[Kind, Record, list[Array]]] = []
    if not any(p.kind in kinds and p.record.size >= fewest for p in pieces):
        return found
    records = [p.record for p in pieces]
    most = STRAIGHT * max(float(np.abs(r.voltage).max()) for r in records)
    for piece, y in zip(pieces, model.free_run(records), strict=True):
        if piece.kind not in kinds:
            continue
        edge = _edge(model, piece.record) if piece.kind is Kind.STEP else 0
        echoes, drive = [(piece.record.displacement - y)[edge:]], piece.record.voltage
        if piece.kind is Kind.LOOP:
            cuts = _sharp_turns(drive)
            parts = zip(np.split(echoes[0], cuts), np.split(drive, cuts), strict=True) if cuts.size else ()
            echoes = [e for e, u in parts if u.size >= fewest and _bend(u) <= most]
        if echoes := [e for e in echoes if e.size >= fewest]:
            found.append((piece.kind, piece.record, echoes))
    return found


def _edge(model: Model, step: Record) -> int:
    """Number of samples of a step that a largest slope of the drive forms, whose misfit hides the lines; 0 without one.

    Until the mode is part of the model, the slope is not accurate, and the misfit of the edge has all frequencies.
    """
    if AmplifierSlewLimitHeld.name not in model:
        return 0
    height = abs(float(step.voltage[-1]) - step.settled_voltage)
    return FORCED + int(np.ceil(height / (model[AmplifierSlewLimitHeld.name]["S"] * step.sample_period)))


def _bend(voltage: Array) -> float:
    """Largest deviation from a straight line [V]; a bent drive excites the loop, whose harmonics are no ringing."""
    at = np.arange(voltage.size)
    return float(np.abs(voltage - np.polynomial.Polynomial.fit(at, voltage, 1)(at)).max())


def _sharp_turns(voltage: Array) -> NDArray[np.int64]:
    """Samples at which the slope of the drive jumps."""
    bends = np.abs(np.diff(voltage, 2))
    if bends.size == 0:
        return np.empty(0, np.int64)
    least = max(SHARP * float(np.median(bends)), STILL * float(np.ptp(voltage)))
    return np.flatnonzero(bends > least) + 1


def decay_after_steps(model: Model, pieces: Sequence[RecordPiece]) -> Array | None:
    """Coefficients (1, a₁, a₂) of the linear prediction of the residual after steps; None if it does not decay.

    e_k + a₁ e_{k−1} + a₂ e_{k−2} = 0 holds for a mode of any frequency, also for one above half the sampling rate
    (Prony 1795; Hildebrand, Introduction to Numerical Analysis, Sec. 9.4).

    Parameters
    ----------
    model : Model
        Model without a mode.
    pieces : sequence of RecordPiece
        Pieces in order.
    """
    echoes = [e[FORCED:ECHO] for _, _, after in _echoes(model, pieces, (Kind.STEP,), FEWEST) for e in after]
    if not echoes:
        return None
    # the residual is also slow motion, such as creep, which is a straight line in this time
    columns = np.concatenate([scipy.signal.detrend(np.column_stack((e[2:], e[1:-1], e[:-2])), axis=0) for e in echoes])
    decay = np.append(1.0, -np.linalg.lstsq(columns[:, 1:], columns[:, 0], rcond=None)[0])
    return decay if np.abs(np.roots(decay)).max(initial=0.0) < LONGEST else None


def sampled_decay(mode: ExtraResonance, period: float) -> Array:
    """The same coefficients of the samples of a mode."""
    angle = 2.0 * np.pi * mode["f0"] * period
    pole = np.exp(angle * (1j * np.sqrt(1.0 - mode["zeta"] ** 2) - mode["zeta"]))
    return np.array([1.0, -2.0 * pole.real, abs(pole) ** 2])
