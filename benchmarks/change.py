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

"""The change watch: false alarms and memory over hours of simulated stream, detected changes, and cost.

Residuals of four kinds, each 0.05 % of the range RMS, on a stage that is driven with a 20 Hz sine at 5 kHz, and white
residuals with a slow scan of 1 Hz. The model is exact, so the residual is only noise; every stream has its own
baseline. The cost is measured on a model node with a driver at 50 kHz, with a baseline and without.

    scripts/run python -m benchmarks.change --hours 1 --changes 3
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator

import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2

from benchmarks.change_cost import cost
from benchmarks.figures import Figures, alone
from benchmarks.streaming import memory
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

KINDS = {"white": 0.0, "AR(1) 0.9": -PERIOD / np.log(0.9), "4 ms": 4e-3, "0.2 s": 0.2, "white, 1 Hz": 0.0}
"""Correlation time of the residual [s]."""
SLOW = "white, 1 Hz"
"""Kind whose drive is slow, so that the scores of its blocks differ."""
INTERVAL = 600.0
"""Wanted time between false alarms [s]."""
FACTOR = 2.0
"""Promised ratio of the measured interval to the wanted one."""
RIGHT = 0.95
"""Promised share of changes whose group is right after 1 s."""
GROWTH = 20.0
"""Memory by which the process may grow over the hours of one stream [MB]."""


def drive(first: int, size: int, frequency: float = 20.0) -> np.ndarray:
    """Samples of the drive voltage [V]: settled at 3.5 V, then a sine."""
    time = PERIOD * np.arange(first, first + size)
    return 3.5 + 2.5 * np.sin(2 * np.pi * frequency * time) * (time > 0.2)


def changed(change: str, span: float) -> tuple[Model, float, float]:
    """Model, gain and offset [m] of a stage in which one group has changed."""
    if change == "loop":
        return MODEL.with_values({"bouc_wen.A": 1.01 * MODEL.values()["bouc_wen.A"]}), 1.0, 0.0
    if change == "dynamics":
        return MODEL.with_values({"arx.a[0]": -0.62, "arx.b[0]": 0.19}), 1.0, 0.0
    return MODEL, 1.0005 if change == "gain" else 1.0, 0.0005 * span if change == "offset" else 0.0


def stream(kind: str, seconds: float, seed: int, change: str = "") -> Iterator[tuple[float, ChangeWatch]]:
    """Time since the end of the baseline [s] and the watch, block by block; a change comes after a third of it."""
    rng = np.random.default_rng(seed)
    span = float(np.ptp(MODEL.run(drive(0, 50_000), MODEL.rest(3.5))[0]))
    keep = np.exp(-PERIOD / KINDS[kind]) if KINDS[kind] else 0.0
    carried = np.zeros(1)
    predictor, watch = Predictor(PERIOD, MODEL), ChangeWatch(INTERVAL)
    true, state = MODEL, MODEL.rest(3.5)
    gain, offset, frequency = 1.0, 0.0, 1.0 if kind == SLOW else 20.0
    begin, when = round(10.0 / PERIOD / BLOCK), round((BASELINE + 10.0 + seconds / 3) / PERIOD / BLOCK)
    for k in range(round((seconds + BASELINE + 10.0) / PERIOD / BLOCK)):
        if k == begin:
            watch.take_baseline(BASELINE)
        if change and k == when:
            true, gain, offset = changed(change, span)
        u = drive(k * BLOCK, BLOCK, frequency)
        y, state = true.run(u, state)
        white = rng.standard_normal(BLOCK)
        noise, carried = lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white, zi=carried)
        answer = predictor.predict(
            k * BLOCK, round(k * BLOCK * PERIOD * 1e9), u, gain * y + offset + NOISE * span * noise
        )
        watch.add(u, answer, predictor, round((k + 1) * BLOCK * PERIOD * 1e9))
        if watch.baseline is not None and not watch.is_taking:
            yield k * BLOCK * PERIOD - BASELINE - 10.0, watch


def alarms(hours: float) -> Figures:
    """Unchanged stages, and the memory of this process meanwhile."""
    rows, failures, wanted = [], [], 3600.0 * hours / INTERVAL
    for seed, kind in enumerate(KINDS):
        begin, most, count = 0.0, 0.0, 0
        for at, watch in stream(kind, 3600.0 * hours, seed):
            count = watch.alarms
            if at > 600.0 and round(at) % 60 == 0:
                most = max(most, memory(os.getpid()))
                begin = begin or most
        low, high = _poisson(count)
        measured = 3600.0 * hours / count if count else None
        certain = (
            f"{3600.0 * hours / high:.0f} to {3600.0 * hours / low:.0f}" if low else f"> {3600.0 * hours / high:.0f}"
        )
        rows.append((kind, INTERVAL, count, measured, certain, most - begin))
        if high < wanted / FACTOR or low > wanted * FACTOR:
            failures.append(f"{kind}: {count} false alarms in {hours:g} h, expected {wanted:.0f}")
        if most - begin > GROWTH:
            failures.append(f"{kind}: the memory grew by {most - begin:.0f} MB in {hours:g} h")
    heads = (
        "residual",
        "wanted interval, s",
        "false alarms",
        "measured interval, s",
        "95 % interval of it, s",
        "growth, MB",
    )
    return Figures(f"Unchanged stages, {hours:g} h each", heads, rows, tuple(failures))


def _poisson(count: int) -> tuple[float, float]:
    """95 % interval of the mean of a Poisson variable, after one observation of `count`."""
    return float(chi2.ppf(0.025, 2 * count)) / 2 if count else 0.0, float(chi2.ppf(0.975, 2 * count + 2)) / 2


def found(changes: int) -> Figures:
    """Stages in which one group changes."""
    rows, failures, all_right, every = [], [], 0, 0
    for kind in list(KINDS)[:4]:
        for change in ("gain", "loop", "dynamics", "offset"):
            times, right = [], 0
            for seed in range(changes):
                first = None
                for at, watch in stream(kind, 60.0, 100 + seed, change):
                    if at >= 20.0 and first is None and watch.change.statistic > 1.0:
                        first = at
                        times.append(at - 20.0)
                    if first is not None and at >= first + 1.0:
                        right += change in watch.change.groups
                        break
            median = float(np.median(times)) if times else None
            rows.append((kind, change, f"{len(times)} of {changes}", median, f"{right} of {len(times)}"))
            all_right, every = all_right + right, every + changes
            if change == "gain" and (median is None or median > 1.0):
                failures.append(f"{kind}: a change of gain by 0.05 % of range was not found within 1 s")
    if all_right < RIGHT * every:
        failures.append(f"the group is right in {all_right} of {every}, promised {RIGHT:.0%}")
    heads = ("residual", "change", "found", "median time, s", "group right after 1 s")
    return Figures("One group changes", heads, rows, tuple(failures))


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument(
        "--hours", type=float, default=3.0, help="hours without a change for each kind of residual; 0: none"
    )
    parser.add_argument("--changes", type=int, default=6, help="changes of every group per kind of residual; 0: none")
    parser.add_argument("--seconds", type=float, default=30.0, help="seconds of the measurement of the cost; 0: none")


def run(options: argparse.Namespace) -> list[Figures]:
    """Three tables."""
    return [
        *([cost(options.seconds)] if options.seconds else []),
        *([alarms(options.hours)] if options.hours else []),
        *([found(options.changes)] if options.changes else []),
    ]


if __name__ == "__main__":
    alone(__name__)
