"""How long until the voltage falls after a stop, and until a device is safe when its driver dies.

    scripts/run python -m benchmarks.safety_times

Per back end, in the fastest and the slowest of several attempts: from `stop()` to the first sample at the wire of the
(emulated) device that is lower, idle and beside two busy processes; and from SIGKILL and SIGSTOP of a driver process
in motion to the end of its keeper's work.
"""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.wire import PERIOD, TOP, WiredSession, check_wire, device, driver_process

FALLS = 0.02
"""Fall of the voltage that counts [V]."""
WORDS = ("simulated", "memory", "gcs2", "nidaqmx")
ATTEMPTS = 3
TIMEOUT = 1.0
"""The default of `keeper_timeout` [s]."""


def stopped(word: str) -> float:
    """Time from a stop in motion until the wire falls [s]."""
    with device(word) as (name, parameters, amplifier, _):
        s = WiredSession(name, parameters, amplifier)
        s.start()
        s.rises()
        highest, now = 0.0, s.output
        begin = time.monotonic()
        s.acquisition.stop()
        parts = len(s.amplifier.parts)
        while now > highest - FALLS and not (word == "memory" and len(s.amplifier.parts) > parts):
            highest = max(highest, now)
            time.sleep(1e-3)
            now = s.output
        took = time.monotonic() - begin
        s.wait(lambda: not s.acquisition.playback.is_stopping, "rest")
        check_wire(s.wire)
        s.end()
        return took


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


if __name__ == "__main__":
    for load in (0, 2):
        with busy(load):
            for word in WORDS:
                took = [1e3 * stopped(word) for _ in range(ATTEMPTS)]
                print(f"stop, {load} busy processes, {word:10s} {min(took):6.0f} to {max(took):6.0f} ms", flush=True)
    for word in ("gcs2", "nidaqmx"):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            took, fall = kept(word, number)
            print(f"keeper, {number.name}, {word:8s} safe after {took:.2f} s, steepest fall {fall:.0f} V/s", flush=True)
