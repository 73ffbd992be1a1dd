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

"""Time from a stop until the voltage falls, and from the death of a driver until its device is safe.

    scripts/run python -m benchmarks.safety_times [BACK_END...]

Per back end, in the fastest and the slowest of several attempts: from the call of `~/stop` over ROS to the first sample
at the wire of the (emulated) device that is lower, idle, beside two busy processes, under a flood of commands of 16 MB,
and during the transfers of a controller; and from SIGKILL and SIGSTOP of a driver process in motion to the end of its
keeper's work.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.stop_over_ros import StopBench, StopTimes
from benchmarks.streaming import LARGE_BLOCKS
from benchmarks.wire import PERIOD, TOP, check_wire, device, driver_process

WORDS = ("simulated", "memory", "gcs2", "nidaqmx")
ATTEMPTS = 3
CASES = ((0, False, ""), (2, False, ""), (0, True, ""), (2, True, ""), (2, False, "WAV"), (2, False, "DRR?"))
"""Busy processes, whether commands of 16 MB come in without a pause, and the transfer in which the stop comes."""
TIMEOUT = 1.0
"""The default of `keeper_timeout` [s]."""
TRANSFERS = {"": "", "WAV": ", during an upload", "DRR?": ", during a read-out"}
"""First letters of the lines of a GCS 2.0 transfer, in words."""


def kept(word: str, number: signal.Signals) -> tuple[float, float]:
    """Time from the end of a driver in motion until its stage is safe [s], and the steepest fall [V/s]."""
    with device(word) as (name, parameters, amplifier, _), tempfile.TemporaryDirectory() as folder:
        process = driver_process(Path(folder), name, parameters, TIMEOUT)
        while amplifier.output < 0.5 * TOP:
            time.sleep(1e-3)
        begin = time.monotonic()
        process.send_signal(number)
        while "is at its safe voltage" not in (Path(folder) / "log").read_text():
            time.sleep(1e-3)
        took = time.monotonic() - begin
        process.kill()
        process.wait()
        check_wire(amplifier.wire)
        return took, float(-np.diff(amplifier.wire).min()) / PERIOD


def spin() -> None:
    """Take a core."""
    while True:
        pass


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that do nothing but take a core each."""
    processes = [multiprocessing.Process(target=spin, daemon=True) for _ in range(count)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def print_stops(words: Sequence[str], folder: Path) -> None:
    """Rows of the stops of every back end, the driver being a node process."""
    for word in words:
        bench = StopBench(word, folder)
        try:
            for case in CASES:
                if word == "gcs2" or not case[2]:
                    print(f"stop, {word}, {case_times(bench, *case)}", flush=True)
        except TimeoutError as error:  # a device may give up where no core is free
            print(f"stop, {word}, not measured: {error}", flush=True)
        finally:
            bench.end()


def case_times(bench: StopBench, load: int, flooded: bool, transfer: str) -> str:
    """Times of several stops under one load, in words."""
    before = bench.refusals
    with busy(load):
        found = [bench.times(flooded=flooded, transfer=transfer) for _ in range(ATTEMPTS)]
    falls, answers = ([1e3 * getattr(times, name) for times in found] for name in StopTimes._fields)
    words = [
        f"{load} busy processes{TRANSFERS[transfer]}",
        f"falls after {min(falls):.0f} to {max(falls):.0f} ms",
        f"answered after at most {max(answers):.0f} ms",
    ]
    if flooded:
        words.append(f"{bench.refusals - before} commands of 16 MB refused meanwhile")
    return ", ".join(words)


if __name__ == "__main__":
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(LARGE_BLOCKS))  # more of the flood arrives
    with tempfile.TemporaryDirectory() as place:
        print_stops(sys.argv[1:] or WORDS, Path(place))
    for word in (word for word in ("gcs2", "nidaqmx") if word in (sys.argv[1:] or WORDS)):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            took, fall = kept(word, number)
            print(f"keeper, {number.name}, {word:8s} safe after {took:.2f} s, steepest fall {fall:.0f} V/s", flush=True)
