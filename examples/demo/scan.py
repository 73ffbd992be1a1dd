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

"""The end of the demo: the same scan with a linear gain, with the inverse of each model, and after learning.

The compensation node plans and plays. This module only sends the path in metres and reads the sensor.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib as mpl
import numpy as np
from bench import Bench
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from piezo_hysteresis import Model
from piezo_hysteresis.errors import counted
from piezo_hysteresis.identification import DriveLimits
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.report.figures.style import SETTINGS, canvas
from piezo_hysteresis.report.palette import BLACK, BLUE

Array = NDArray[np.float64]

LOW, HIGH = 0.12, 0.82
"""Ends of the scan, as shares of the stroke: below, a unipolar drive could not come back to it after a loop."""
APPROACH = 0.1
"""Duration of the way to the scan and of the way back [s]."""
ROUNDS = 2
"""Corrections by learning."""
TITLES = {"triangle_100hz": "triangle", "slow_raster": "raster"}
"""Path to how it is called in table and figure."""
SHOWN = 0.03
"""End of the fast scan that the figure shows [s]: three periods."""


def paths(period: float) -> dict[str, Array]:
    """The fast and the slow axis of a raster, from 0 to 1: 20 lines at 100 Hz, and a step to the next line 16 times."""
    time = period * np.arange(round(0.2 / period))
    fast = 1.0 - np.abs(2.0 * ((100.0 * time) % 1.0) - 1.0)
    line, step = round(0.06 / period), round(0.005 / period)
    lines = np.concatenate((np.arange(9), np.arange(7, -1, -1))) / 8.0
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(step) / step)
    slow = [np.full(line, lines[0])]
    for begin, end in zip(lines, lines[1:], strict=False):
        slow += [begin + (end - begin) * rise, np.full(line - step, end)]
    return {"triangle_100hz": fast, "slow_raster": np.concatenate(slow)}


@dataclass(frozen=True, eq=False)
class Run:
    """One scan with one method.

    Attributes
    ----------
    method : str
        How the drive was found.
    error : (n,) ndarray
        Measured minus wanted displacement along the scan, NaN where a sample was lost [m]; empty where it was refused.
    expected : float
        Rms error that was expected before it was played [m].
    note : str
        Reason of a refusal, or result of the rounds of learning; empty otherwise.
    """

    method: str
    error: Array = field(default_factory=lambda: np.empty(0))
    expected: float = float("nan")
    note: str = ""

    @property
    def rms(self) -> float:
        """Measured, the noise of the sensor included [m]."""
        return float(np.sqrt(np.nanmean(self.error**2))) if self.error.size else float("nan")


class Scan:
    """Plays the scan with every method and keeps the measurements.

    Parameters
    ----------
    bench : Bench
        Where the nodes are reached.
    limits : DriveLimits
        Of the drive.
    identified : Model
        From which the stroke of the stage is taken.
    """

    def __init__(self, bench: Bench, limits: DriveLimits, identified: Model) -> None:
        self._bench, self._limits = bench, limits
        ramp = limits.path(np.array([limits.safe_voltage, limits.voltage_max]), limits.ramp_rate)
        y, _ = identified.run(ramp, identified.rest(limits.safe_voltage))
        self._base, self.stroke = float(y[0]), float(y[-1] - y[0])
        shapes = paths(limits.sample_period)
        self.wanted = {name: self._base + self.stroke * (LOW + (HIGH - LOW) * shape) for name, shape in shapes.items()}
        self.runs: dict[str, list[Run]] = {name: [] for name in shapes}

    def linear(self, model: Model) -> None:
        """Voltage in proportion to the displacement; the error that `model` expects of it."""
        safe, count = self._limits.safe_voltage, self._limits.samples(APPROACH)
        way = 0.5 - 0.5 * np.cos(np.pi * np.arange(count) / count)
        for name, wanted in self.wanted.items():
            body = safe + (self._limits.voltage_max - safe) * (wanted - self._base) / self.stroke
            drive = np.concatenate((safe + (body[0] - safe) * way, body, safe + (body[-1] - safe) * way[::-1]))
            part = slice(count, count + body.size)
            predicted, _ = model.run(drive, model.rest(safe))
            expected = float(np.sqrt(np.mean((predicted[part] - wanted) ** 2)))
            measured = self._bench.play_measured(drive, f"linear_{name}")[part]
            self.runs[name].append(Run("linear gain", measured - wanted, expected))

    def follow(self, method: str) -> None:
        """Send every path to the compensation node, which drives it through the inverse of its present model."""
        for name, wanted in self.wanted.items():
            phase = f"{method.split()[0]}_{name}"
            status = self._bench.follow(wanted, phase)
            refused = "" if values_of(status)["state"] == "done" else status.message
            self.runs[name].append(self._run(method, wanted, values_of(status), refused))

    def learn(self, method: str) -> None:
        """Send the paths once more, and let the node correct the measured error; the best round counts."""
        for name, wanted in self.wanted.items():
            best = end = self._bench.follow(wanted, f"learning_{name}")
            if values_of(best)["state"] == "done":
                best, end = self._bench.learn()
            number = values_of(best)["phase"].rpartition("_")[2]
            label = f"{method}, {counted(int(number), 'correction')}" if number.isdecimal() else method
            self.runs[name].append(self._run(label, wanted, values_of(best), end.message))

    def _run(self, method: str, wanted: Array, values: dict[str, str], note: str) -> Run:
        if "first_index" not in values:
            return Run(method, note=note)
        measured = self._bench.measured(int(values["first_index"]), wanted.size)
        return Run(method, measured - wanted, float(values["expected"]), note)

    def show(self, console: Console) -> None:
        """One table: the expected and the measured error of both paths."""
        span = 1e6 * (HIGH - LOW) * self.stroke
        table = Table(title=f"Error of a scan over {span:.3g} µm, rms in % of it, the noise of the sensor included")
        table.add_column("drive", no_wrap=True)
        for name in self.wanted:
            for word in ("expected", "measured"):
                table.add_column(f"{TITLES[name]}\n{word}", justify="right", no_wrap=True)
        for rows in zip(*self.runs.values(), strict=True):
            cells = [text for run in rows for text in (self._percent(run.expected), self._percent(run.rms))]
            table.add_row(rows[0].method.partition(",")[0], *cells)
        console.print(table)
        for name, runs in self.runs.items():
            for run in runs:
                if run.note:
                    console.print(f"          {TITLES[name]}, {run.method}: {run.note}")

    def _percent(self, error: float) -> str:
        return f"{100.0 * error / ((HIGH - LOW) * self.stroke):.3g}" if np.isfinite(error) else "refused"

    def save(self, folder: Path) -> None:
        """Write the table and the figure."""
        with (folder / "scan.csv").open("w", newline="") as file:
            table = csv.writer(file)
            table.writerow(("path", "drive", "expected_rms_m", "measured_rms_m", "range_m"))
            for name, runs in self.runs.items():
                span = float(np.ptp(self.wanted[name]))
                table.writerows((name, r.method, f"{r.expected:.6g}", f"{r.rms:.6g}", f"{span:.6g}") for r in runs)
        with mpl.rc_context(SETTINGS):
            count = 1 + max(len(runs) for runs in self.runs.values())
            figure, axes = canvas(count, 2, 1.35 * count + 0.4, sharex="col")
            for column, (name, wanted) in enumerate(self.wanted.items()):
                part = slice(-round(SHOWN / self._limits.sample_period), None) if column == 0 else slice(None)
                time = 1e3 * self._limits.sample_period * np.arange(wanted.size)[part]
                every = slice(None, None, max(1, time.size // 5000))
                top, *rest = axes[:, column]
                top.plot(time[every], 1e6 * wanted[part][every], color=BLACK, linewidth=1.0)
                top.set(ylabel="wanted [µm]", title=TITLES[name])
                for ax, run in zip(rest, self.runs[name], strict=True):
                    title = f"{run.method}: refused"
                    if run.error.size:
                        ax.plot(time[every], 1e9 * run.error[part][every], color=BLUE, linewidth=0.7)
                        title = f"{run.method}: {_length(run.rms)} rms, expected {_length(run.expected)}"
                    ax.set_ylabel("error [nm]")
                    ax.set_title(title, fontsize="small")
                axes[-1, column].set_xlabel("time [ms]")
            figure.savefig(folder / "scan.png")


def _length(value: float) -> str:
    return f"{1e6 * value:.3g} µm" if value >= 1e-6 else f"{1e9 * value:.3g} nm"
