"""`python -m benchmarks.change`: false alarms of the change watch over hours of simulated stream, and what it finds.

Residuals of four kinds, 0.05 % of range rms each, on a stage that is driven with a 20 Hz sine at 5 kHz. The model is
exact, so that all of the residual is noise; every stream has a baseline of its own.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import lfilter

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.change.watch import ChangeWatch
from piezo_hysteresis.online.predictor import Predictor

PERIOD = 2e-4
BLOCK = 500
NOISE = 5e-4
"""Rms of the residual over the range."""

BASELINE = 300.0
"""Time over which each baseline is taken [s]."""

MODEL = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,))), PERIOD, displacement_scale=1e-5)

KINDS = {"white": 0.0, "AR(1) 0.9": -PERIOD / np.log(0.9), "4 ms": 4e-3, "0.2 s": 0.2}
"""Correlation time of the residual [s]."""


def drive(first: int, size: int) -> np.ndarray:
    """Samples of the drive voltage [V]: settled at 3.5 V, then a sine."""
    time = PERIOD * np.arange(first, first + size)
    return 3.5 + 2.5 * np.sin(2 * np.pi * 20.0 * time) * (time > 0.2)


def changed(change: str, span: float) -> tuple[Model, float, float]:
    """Model, gain and offset [m] of a stage in which one group has moved."""
    if change == "loop":
        return MODEL.with_values({"bouc_wen.A": 1.01 * MODEL.values()["bouc_wen.A"]}), 1.0, 0.0
    if change == "dynamics":
        return MODEL.with_values({"arx.a[0]": -0.62, "arx.b[0]": 0.19}), 1.0, 0.0
    return MODEL, 1.001 if change == "gain" else 1.0, 0.0005 * span if change == "offset" else 0.0


def stream(kind: str, seconds: float, seed: int, change: str = "") -> Iterator[tuple[float, ChangeWatch]]:
    """Time since the end of the baseline [s] and the watch, block by block; a change comes after a third of it."""
    rng = np.random.default_rng(seed)
    span = float(np.ptp(MODEL.run(drive(0, 50_000), MODEL.rest(3.5))[0]))
    keep = np.exp(-PERIOD / KINDS[kind]) if KINDS[kind] else 0.0
    carried = np.zeros(1)
    predictor, watch = Predictor(PERIOD, MODEL), ChangeWatch(INTERVAL)
    true, state = MODEL, MODEL.rest(3.5)
    gain, offset = 1.0, 0.0
    begin, when = round(10.0 / PERIOD / BLOCK), round((BASELINE + 10.0 + seconds / 3) / PERIOD / BLOCK)
    for k in range(round((seconds + BASELINE + 10.0) / PERIOD / BLOCK)):
        if k == begin:
            watch.take_baseline(BASELINE)
        if change and k == when:
            true, gain, offset = changed(change, span)
        u = drive(k * BLOCK, BLOCK)
        y, state = true.run(u, state)
        white = rng.standard_normal(BLOCK)
        noise, carried = lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white, zi=carried)
        answer = predictor.predict(
            k * BLOCK, round(k * BLOCK * PERIOD * 1e9), u, gain * y + offset + NOISE * span * noise
        )
        watch.add(u, answer, predictor, round((k + 1) * BLOCK * PERIOD * 1e9))
        if watch.baseline is not None and not watch.is_taking:
            yield k * BLOCK * PERIOD - BASELINE - 10.0, watch


INTERVAL = 600.0
"""Wanted time between false alarms [s]."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=3.0, help="stream without a change per kind of residual")
    parser.add_argument("--changes", type=int, default=6, help="changes of every group per kind of residual")
    options = parser.parse_args(arguments)
    alarms = Table("residual", "wanted interval", "alarms", "measured interval", title="nothing changes")
    for seed, kind in enumerate(KINDS):
        *_, (_, watch) = stream(kind, 3600.0 * options.hours, seed)
        measured = f"{3600 * options.hours / watch.alarms:.0f} s" if watch.alarms else f"> {3600 * options.hours:.0f} s"
        alarms.add_row(kind, f"{INTERVAL:.0f} s", str(watch.alarms), measured)
    found = Table("residual", "change", "found", "median time", "group right after 1 s", title="one group changes")
    for kind in KINDS:
        for change in ("gain", "loop", "dynamics", "offset"):
            times, right = [], 0
            for seed in range(options.changes):
                first = None
                for at, watch in stream(kind, 60.0, 100 + seed, change):
                    if at >= 20.0 and first is None and watch.change.statistic > 1.0:
                        first = at
                        times.append(at - 20.0)
                    if first is not None and at >= first + 1.0:
                        right += change in watch.change.groups
                        break
            median = f"{np.median(times):.1f} s" if times else "-"
            found.add_row(kind, change, f"{len(times)} of {options.changes}", median, f"{right} of {len(times)}")
    console = Console(width=110)
    console.print(alarms)
    console.print(found)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
