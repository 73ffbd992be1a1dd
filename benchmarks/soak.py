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

"""`make soak`: 50 kHz with random faults; counts all samples that were sent and received, and prints the balance.

A driver whose stage logs every voltage that it receives, a model node and a recorder run as processes. This process
sends commands without a pause, receives everything, and causes one fault after the other. After each fault, samples
must arrive and predictions must be right again. The exit code is 1 if a promise was broken. The seed determines the
faults, their times and their durations.

    make soak SOAK="--minutes 1 --seed 3"
    make soak SOAK="--minutes 10 --rate 100000 --no-faults"

Without faults the processes are never started again, so that the growth of their memory can be measured.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from benchmarks.figures import Cell, Figures, console, machine
from benchmarks.soak_faults import FAULTS, Bench
from benchmarks.soak_keeper import BEFORE, LOST, Keeper
from benchmarks.soak_processes import Soaked
from benchmarks.stage_log import STEP, StageLog
from benchmarks.streaming import LARGE_BLOCKS
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps, load

ROOT = Path(__file__).parent.parent
MODEL = ROOT / "config" / "published_stage.yaml"
LIMITS = {"voltage_min": 0.0, "voltage_max": 10.0, "max_slew_rate": 2e4, "ramp_rate": 100.0}
FALSE_SHARE = 0.02
"""Of the range: simulated stage and model are other code, 0.3 % apart in a free run."""
RECOVERY = 60.0
"""Longest way from a fault to good predictions [s]: a killed node compiles, and loops must be forgotten."""
ALLOWED = 5000
"""Samples that may be on their way from a driver when it is killed: ten blocks."""
LARGEST = 600.0
"""Resident size that no process may exceed [MB]."""
SETTLED = 120.0
"""Time after the start of a run from which the growth of memory counts [s]: buffers fill, kernels are loaded."""
PEAK = 60.0
"""Time of which the largest size counts [s]: the history of a model node is cut back every half minute."""
GROWTH = 5.0
"""Growth of the resident size that no process may exceed in a run without faults [MB/min].

At 100 kHz 190 MB of samples and 240 MB of predictions pass through in a minute. A recorder keeps the index of its file
until its end, 0.7 MB/min for each of the two; the rest is what waits where no core is free.
"""


class Traffic:
    """Commands without a pause: loops of several frequencies from 0 V and back, in a thread."""

    def __init__(self, keeper: Keeper, sample_period: float, chance: random.Random) -> None:
        self._keeper, self._period, self._chance = keeper, sample_period, chance
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        number = 0
        while not self._ended.is_set():
            number += 1
            frequency, top = self._chance.choice([5, 10, 20, 50]), self._chance.uniform(4.0, 7.0)
            cycles = max(4, round(frequency * self._chance.uniform(0.5, 3.0)))
            size = round(cycles / frequency / self._period)
            wave = top / 2 * (1 - np.cos(2 * np.pi * cycles * np.arange(size + 1) / size))
            name = f"loops_{number}"
            self._keeper.send(wave, name, self._period)
            deadline = time.monotonic() + 2.0
            while not self._ended.wait(0.02):
                fate = self._keeper.fate(name)
                if fate in ("done", "stopped", "refused"):
                    break
                if not fate and time.monotonic() > deadline:
                    break  # the driver is away
                if fate and time.monotonic() > deadline + size * self._period + 5.0:
                    break  # it was killed

    def close(self) -> None:
        """End the commands."""
        self._ended.set()
        self._thread.join(10.0)


class Soak:
    """One run.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command line.
    folder : pathlib.Path
        For logs and recordings.
    """

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        period = 1.0 / options.rate
        self.minutes, self.chance = options.minutes, random.Random(options.seed)
        self.has_faults = options.faults
        self.log = StageLog(folder / "voltages", period, **LIMITS)
        model = load(MODEL)
        model = Model(model.effects, period, model.voltage_scale, model.displacement_scale)
        driver: dict[str, object] = {**LIMITS, "sample_period": f"{period:.12f}", "discovery_time": 0.1}
        file = folder / "model.yaml"
        file.write_text(dumps(model), encoding="utf-8")
        self.soaked = Soaked(folder, self.log, {"driver_node": driver, "model_node": {"model_file": file}})
        displacement = model.run(np.linspace(0.0, 7.0, 1000), model.rest(0.0))[0]
        self.keeper = Keeper(FALSE_SHARE * float(np.ptp(displacement)), 1.001 * STEP)
        other = Model(model.effects, period, model.voltage_scale, model.displacement_scale, {"name": "the same"})
        self.bench = Bench(self.soaked, self.keeper, self.chance, (dumps(model), dumps(other)), period)
        self.struck: Counter[str] = Counter()
        self.memory: list[tuple[float, dict[str, float]]] = []
        self.slowest = 0.0

    def run(self, console: Console) -> None:
        """Start, strike until the time is over, end."""
        for name in self.soaked.starts:
            self.soaked.start(name)
        traffic = Traffic(self.keeper, self.bench.sample_period, random.Random(self.chance.random()))
        try:
            self._recover("the start")
            begin = time.monotonic()
            while time.monotonic() - begin < 60.0 * self.minutes:
                if not self.has_faults:
                    self._rest(60.0 * self.minutes)
                    break
                self._rest(self.chance.uniform(0.5, 5.0))
                fault = self.chance.choice(list(FAULTS))
                self.struck[fault] += 1
                console.print(f"[dim]{time.monotonic() - begin:6.1f} s  {fault}[/]", highlight=False)
                FAULTS[fault](self.bench)
                self._recover(fault)
        finally:
            traffic.close()
            self.soaked.end()
            time.sleep(0.5)
            self.keeper.close()

    def _rest(self, duration: float) -> None:
        end = time.monotonic() + duration
        while time.monotonic() < end:
            self.soaked.check()
            sizes = {name: self.soaked.memory(name) for name in self.soaked.starts}
            self.memory.append((time.monotonic(), sizes))
            for name, size in sizes.items():
                if size > LARGEST:
                    self.keeper.break_promise(f"{name} holds {size:.0f} MB")
            time.sleep(0.25)

    def _recover(self, fault: str) -> None:
        """Wait until samples flow and a prediction of new ones is good."""
        begin = time.monotonic()
        self._rest(0.25)
        self.keeper.is_good = False
        while not self.keeper.is_good:
            self._rest(0.25)
            if time.monotonic() - begin > RECOVERY:
                self.keeper.break_promise(f"no good prediction within {RECOVERY:g} s after {fault}")
                return
        self.slowest = max(self.slowest, time.monotonic() - begin)

    def _growth(self, name: str) -> float:
        """Slope of the largest resident sizes of a process [MB/min], least squares from `SETTLED` on."""
        times, sizes = np.array([(time, sizes[name]) for time, sizes in self.memory]).T
        window = ((times - times[0] - SETTLED) // PEAK).astype(int)
        peaks = [sizes[window == k].max() for k in range(window[-1])]
        slope = 60.0 / PEAK * float(np.polyfit(np.arange(len(peaks)), peaks, 1)[0])
        if slope > GROWTH:
            self.keeper.break_promise(f"{name} grows by {slope:.2f} MB/min")
        return slope

    def balance(self) -> Figures:
        """The table."""
        for death in self.soaked.deaths:
            self.keeper.break_promise(death)
        try:
            self.log.check()
            outside = "none"
        except AssertionError as error:
            outside = "some"
            self.keeper.break_promise(f"voltages outside the limits or too steep: {error}")
        applied = self.log.given
        counts = self.keeper.counts
        unaccounted = applied - counts["samples received"] - counts[LOST] - counts[BEFORE]
        if abs(unaccounted) > ALLOWED * self.soaked.starts["driver_node"]:
            self.keeper.break_promise(f"{unaccounted} samples neither received nor reported lost")
        rows: list[tuple[Cell, ...]] = [("voltages given to the stage", applied), ("outside limits or slew", outside)]
        rows += [("given, neither received nor reported lost: the last blocks of killed drivers", unaccounted)]
        rows += [(name, counts[name]) for name in sorted(counts) if name != "promises broken"]
        rows += [(f"fault: {name}", self.struck[name]) for name in FAULTS]
        rows += [("slowest recovery, s", self.slowest)]
        for name in self.soaked.starts:
            rows.append((f"memory of {name}, largest, MB", max(sizes[name] for _, sizes in self.memory)))
        if not self.has_faults:
            rows += [(f"growth of {name}, MB/min", self._growth(name)) for name in self.soaked.starts]
        rows += [("promises broken", counts["promises broken"])]
        return Figures("Soak: samples sent and received", ("", "count"), rows, tuple(self.keeper.broken))


def main() -> int:
    """Run a soak; 1 where a promise was broken."""
    parser = argparse.ArgumentParser(
        prog="soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="default: 10")
    parser.add_argument("--seed", type=int, default=0, help="fixes the faults; default: 0")
    parser.add_argument("--rate", type=float, default=50e3, help="samples per second; default: 50000")
    parser.add_argument("--no-faults", dest="faults", action="store_false", help="cause no faults")
    options = parser.parse_args()
    if not options.faults and options.minutes < 5:
        parser.error(f"--no-faults: got --minutes {options.minutes:g}, expected at least 5")
    os.environ.setdefault("ROS_DOMAIN_ID", str(101 + os.getpid() % 100))  # the tests use those up to 100
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(LARGE_BLOCKS))
    out = console()
    out.print(", ".join(f"{key} {value}" for key, value in machine().items()), highlight=False)
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(ROS_LOG_DIR=folder)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        soak = Soak(options, Path(folder))
        soak.run(out)
        figures = soak.balance()
    out.print(figures.table())
    for line in figures.failures:
        out.print(f"[red]broken:[/] {line}", highlight=False)
    out.print("every promise kept" if not figures.failures else f"{len(figures.failures)} promises broken")
    return int(bool(figures.failures))


if __name__ == "__main__":
    sys.exit(main())
