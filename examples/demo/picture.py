"""The live residual of the same waveform under each model, one below the other."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from bench import Trace
from numpy.typing import NDArray

from piezo_hysteresis.report.figures.style import SETTINGS, canvas
from piezo_hysteresis.report.palette import BLACK


def save(path: Path, voltage: NDArray, sample_period: float, traces: Mapping[str, Trace]) -> None:
    """Draw the drive and the residual of every model on one scale, and write the file."""
    with mpl.rc_context(SETTINGS):
        figure, axes = canvas(1 + len(traces), 1, 1.3 * (1 + len(traces)) + 0.4, sharex=True)
        drive, *residuals = axes[:, 0]
        every = slice(None, None, max(1, voltage.size // 20_000))
        drive.plot(sample_period * np.arange(voltage.size)[every], voltage[every], color=BLACK, linewidth=0.8)
        drive.set(ylabel="u [V]", title="drive, the same for every model")
        reach = 1.05e9 * max(float(np.abs(trace.residual).max()) for trace in traces.values())
        for ax, (name, trace) in zip(residuals, traces.items(), strict=True):
            ax.plot(trace.time[every], trace.residual[every] * 1e9, color=BLACK, linewidth=0.5)
            ax.set(ylabel="residual [nm]", ylim=(-reach, reach), title=f"{name}: {trace.rms * 1e9:.0f} nm rms")
        axes[-1, 0].set_xlabel("time [s]")
        figure.savefig(path)
