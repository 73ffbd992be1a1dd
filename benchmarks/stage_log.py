"""`StageLog`: the voltages that a stage was given, as the watched driver wrote them down."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import piezo_hysteresis

STEP = 20.0 / 2**16
"""Step of the converter of the simulated stage [V]. The applied and the reported voltage are rounded to it."""


class StageLog:
    """A log and the limits that every sample in it must keep.

    Parameters
    ----------
    path : Path
        Of the log.
    sample_period : float
        Time between samples [s].
    voltage_min, voltage_max, max_slew_rate, ramp_rate : float
        Limits of the driver.
    """

    def __init__(
        self,
        path: Path,
        sample_period: float,
        voltage_min: float,
        voltage_max: float,
        max_slew_rate: float,
        ramp_rate: float,
    ) -> None:
        self.path, self._step = path, max_slew_rate * sample_period
        self._low, self._high = voltage_min, voltage_max
        self.environment = {"PYTHONPATH": str(Path(piezo_hysteresis.__file__).parents[1])}
        self.driver = [sys.executable, str(Path(__file__).with_name("watched_driver.py")), str(path)]

    @property
    def voltages(self) -> np.ndarray:
        """Everything that the stage was given [V]; NaN where a driver began."""
        data = self.path.read_bytes()
        return np.frombuffer(data[: len(data) // 8 * 8])

    @property
    def starts(self) -> int:
        """Drivers that were started."""
        return int(np.isnan(self.voltages).sum())

    def shift_clock(self, offset: float) -> None:
        """Let the clock of the computer be off by so much [s], as drivers see it."""
        draft = self.path.with_name("clock.tmp")
        draft.write_text(str(offset))
        draft.replace(f"{self.path}.clock")

    def check(self) -> None:
        """Every sample is inside the limits, and no steeper than allowed, from the safe voltage of every start on."""
        voltages = self.voltages
        begins = np.isnan(voltages)
        given = voltages[~begins]
        assert given.size > 100
        assert self._low <= given.min()
        assert given.max() <= self._high
        step = np.abs(np.diff(np.where(begins, 0.0, voltages)))
        step[begins[1:]] = 0.0
        assert step.max() <= self._step * (1 + 1e-9) + STEP
