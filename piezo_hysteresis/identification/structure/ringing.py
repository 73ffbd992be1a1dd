"""The frequency at which a stage rings behind a step, from what a model without a mode leaves there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.model import Model
from .pieces import Kind, RecordPiece

CYCLES = 4.0
"""Fewest cycles in the piece behind the step."""
RESOLVED = 0.45
"""Highest frequency, cycles per sample: faster modes are a lag."""
STANDS_OUT = 10.0
"""Power of the highest line over the median of its spectrum."""


def ringing_frequency(model: Model, pieces: Sequence[RecordPiece]) -> float | None:
    """Frequency of the highest line of the residual behind steps [Hz]; None where none stands out.

    Parameters
    ----------
    model : Model
        Without a mode.
    pieces : sequence of RecordPiece
        In order.
    """
    steps = [p.kind is Kind.STEP and p.record.size >= 4 * CYCLES for p in pieces]
    if not any(steps):
        return None
    best: tuple[float, float] | None = None
    for y, piece, wanted in zip(model.free_run([p.record for p in pieces]), pieces, steps, strict=True):
        if not wanted:
            continue
        e = piece.record.displacement - y
        t = np.linspace(-1.0, 1.0, e.size)
        e = e - np.polynomial.Polynomial.fit(t, e, 2)(t)
        size = 8 * e.size
        frequency = np.fft.rfftfreq(size, piece.record.sample_period)
        power = np.abs(np.fft.rfft(e, size)) ** 2
        low, high = CYCLES / piece.record.duration, RESOLVED / piece.record.sample_period
        band = (frequency > low) & (frequency < high)
        if not band.any():
            continue
        top = int(np.argmax(np.where(band, power, 0.0)))
        height = float(power[top] / np.median(power[band]))
        if height > STANDS_OUT and (best is None or height > best[0]):
            best = (height, float(frequency[top]))
    return None if best is None else best[1]
