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

"""How a stage rings after a step, from the residual of a model without a mode: its frequency, or its decay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects import ExtraResonance
from ...model.model import Model
from ...record import Record
from .pieces import Kind, RecordPiece

Array = NDArray[np.float64]

CYCLES = 4.0
"""Smallest number of cycles in the piece after the step."""
RESOLVED = 0.45
"""Highest frequency [cycles per sample]; a faster mode acts as a lag."""
SLOWEST = next(p.lower for p in ExtraResonance.parameters if p.name == "f0")
"""Lowest frequency of a mode [Hz]."""
ECHO = 40
"""Number of samples after a step from which the decay is estimated; their second half shows where it ends."""
FEWEST = 12
"""Smallest number of such samples."""
LONGEST = 0.95
"""Largest radius of the poles of a decay; a longer one is the work of a mode that the samples show, or creep."""
STANDS_OUT = 10.0
"""Smallest ratio of the highest spectral line to the median of the spectrum, in power."""


def ringing_frequency(model: Model, pieces: Sequence[RecordPiece]) -> float | None:
    """Frequency of the highest spectral line of the residual after steps [Hz]; None if no line stands out.

    Parameters
    ----------
    model : Model
        Model without a mode.
    pieces : sequence of RecordPiece
        Pieces in order.
    """
    best: tuple[float, float] | None = None
    for record, e in _after_steps(model, pieces, 4 * CYCLES):
        t = np.linspace(-1.0, 1.0, e.size)
        e = e - np.polynomial.Polynomial.fit(t, e, 2)(t)
        size = 8 * e.size
        frequency = np.fft.rfftfreq(size, record.sample_period)
        power = np.abs(np.fft.rfft(e, size)) ** 2
        low, high = max(CYCLES / record.duration, SLOWEST), RESOLVED / record.sample_period
        band = (frequency > low) & (frequency < high)
        if not band.any():
            continue
        top = int(np.argmax(np.where(band, power, 0.0)))
        height = float(power[top] / np.median(power[band]))
        if height > STANDS_OUT and (best is None or height > best[0]):
            best = (height, float(frequency[top]))
    return None if best is None else best[1]


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
    echoes = [e[:ECHO] for _, e in _after_steps(model, pieces, FEWEST)]
    if not echoes:
        return None
    echoes = [e - e[e.size // 2 :].mean() for e in echoes]
    before = np.concatenate([np.column_stack((e[1:-1], e[:-2])) for e in echoes])
    after = np.concatenate([e[2:] for e in echoes])
    decay = np.append(1.0, -np.linalg.lstsq(before, after, rcond=None)[0])
    return decay if np.abs(np.roots(decay)).max(initial=0.0) < LONGEST else None


def _after_steps(model: Model, pieces: Sequence[RecordPiece], fewest: float) -> list[tuple[Record, Array]]:
    """Records and residuals of the pieces after steps that have at least `fewest` samples."""
    steps = [p.kind is Kind.STEP and p.record.size >= fewest for p in pieces]
    if not any(steps):
        return []
    records = [p.record for p in pieces]
    runs = zip(records, model.free_run(records), steps, strict=True)
    return [(record, record.displacement - y) for record, y, is_step in runs if is_step]
