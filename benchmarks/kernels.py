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

"""Kernels compared with the same loops in C, and with scipy and plain Python.

Our kernels and C are measured alternately, C with gcc -O3 with and without -march=native, because numba compiles for
the present machine. The results are compared before the measurement. Processor time of one core, after compilation.

    python -m benchmarks.kernels --samples 10000000
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from benchmarks.c_loops import CLoops, compiler
from benchmarks.figures import Cell, Figures, alone, seconds
from benchmarks.simulation import ARX, PERIOD, measure, record
from piezo_hysteresis.blocks.arx import ArxBlock, arx_row
from piezo_hysteresis.effects import BoucWen, Effect, PublishedBoucWen
from piezo_hysteresis.effects.hysteresis.published_bouc_wen import run_published
from piezo_hysteresis.model.chain import BLOCK
from piezo_hysteresis.model.model import Model

FLAGS = (("-O3",), ("-O3", "-march=native"))
LOOP = PublishedBoucWen()
NUMBERS = np.array([LOOP[n] for n in ("A", "beta", "gamma", "p1", "p2")])
SCALES = (10.0, 1e-5)
PYTHON = 20
"""Ratio of the number of samples to that for plain Python."""
CHAINS: dict[str, tuple[Effect, ...]] = {
    "Eq. (7)": (PublishedBoucWen(),),
    "Eq. (7) + delay + ARX(8,8)": (PublishedBoucWen(), ARX),
    "exact step": (BoucWen(),),
    "exact step + delay + ARX(8,8)": (BoucWen(), ARX),
}
Work = Callable[[], np.ndarray]


def python_loop(v: np.ndarray) -> np.ndarray:
    """Eq. (6) and (7) in plain Python."""
    a, beta, gamma, p1, p2 = NUMBERS.tolist()
    h, last, w = 0.0, float(v[0]), []
    for x in v.tolist():
        dv = x - last
        last = x
        h += a * dv - beta * abs(dv) * h - gamma * dv * abs(h)
        w.append(p1 * x * x * x + p2 * x + h)
    return np.array(w)


def python_chain(u: np.ndarray) -> np.ndarray:
    """The loop in plain Python, the dynamics by `scipy.signal.lfilter`."""
    w = python_loop(u / SCALES[0])
    start = LOOP["p1"] * (u[0] / SCALES[0]) ** 3 + LOOP["p2"] * u[0] / SCALES[0]
    taps = np.concatenate((np.zeros(round(ARX["delay"])), ARX.array("b")))
    return SCALES[1] * (ARX.dc_gain * start + lfilter(taps, np.append(1.0, ARX.array("a")), w - start))


def own_loop(v: np.ndarray) -> Work:
    """Our kernel of Eq. (6) and (7)."""
    p, w = np.array([LOOP[n] for n in ("A", "beta", "gamma", "n", "p1", "p2")]), np.empty_like(v)

    def work() -> np.ndarray:
        run_published(v, p, np.array([0.0, v[0]]), w)
        return w

    return work


def own_chain(u: np.ndarray) -> Work:
    """`Model.run` as a user calls it, with its checks and copies."""
    model = Model((LOOP, ARX), PERIOD, *SCALES)
    return lambda: model.run(u, model.rest(float(u[0])))[0]


def own_kernels(u: np.ndarray) -> Work:
    """The kernels of the chain alone, block by block as `Model.run` calls them."""
    arx, v, y = ArxBlock((), ARX.array("a"), ARX.array("b"), ARX["delay"]), u / SCALES[0], np.empty_like(u)
    p, w = np.array([LOOP[n] for n in ("A", "beta", "gamma", "n", "p1", "p2")]), np.empty(BLOCK)
    w0 = LOOP["p1"] * v[0] ** 3 + LOOP["p2"] * v[0]

    def work() -> np.ndarray:
        state, z = np.array([0.0, v[0]]), arx.zeros(1)
        for start in range(0, v.size, BLOCK):
            part = v[start : start + BLOCK]
            run_published(part, p, state, w)
            near, out = w[: part.size], y[start : start + BLOCK]
            arx_row(near, w0, arx.gain * w0, arx.taps, arx.offset, arx.feedback, z[0], out)
        return np.multiply(y, SCALES[1], out=y)

    return work


def c_works(u: np.ndarray, loops: CLoops) -> tuple[Work, Work, Work]:
    """In C: the loop, the chain that hands out fresh memory as `Model.run` does, and the chain in memory at hand."""
    v, w, y = u / SCALES[0], np.empty(u.size + 100), np.empty(u.size)
    a, b, delay = ARX.array("a"), ARX.array("b"), round(ARX["delay"])

    def loop() -> np.ndarray:
        loops.bouc_wen(v, NUMBERS, w)
        return w[: v.size]

    def chain(y: np.ndarray) -> np.ndarray:
        loops.chain(u, SCALES, NUMBERS, delay, a, b, w, y)
        return y

    return loop, lambda: chain(np.empty(u.size)), lambda: chain(y)


def compare(u: np.ndarray) -> Figures:
    """The published loop and chain: ours, C and Python."""
    short, v = u[: u.size // PYTHON], u / SCALES[0]
    cases: list[tuple[str, Work, Work]] = [
        ("Eq. (6), (7)", own_loop(v), lambda: python_loop(short / SCALES[0])),
        ("Eq. (7) + delay + ARX(8,8), Model.run", own_chain(u), lambda: python_chain(short)),
        ("Eq. (7) + delay + ARX(8,8), kernels alone", own_kernels(u), lambda: python_chain(short)),
    ]
    rows: list[tuple[Cell, ...]] = []
    with tempfile.TemporaryDirectory() as folder:
        built = [c_works(u, CLoops(Path(folder), flags)) for flags in FLAGS] if compiler() else []
        for k, (name, own, python) in enumerate(cases):
            peers = [works[k] for works in built]
            for peer in peers:
                np.testing.assert_allclose(peer(), own(), rtol=1e-9, atol=1e-12 * np.ptp(own()))
            np.testing.assert_allclose(python(), own()[: short.size], rtol=1e-9, atol=1e-12 * np.ptp(own()))
            mine, *others = seconds(own, *peers, repeats=9 if u.size < 5e6 else 3)
            (slow,) = seconds(python, repeats=2)
            speed, python_speed = u.size / mine / 1e6, short.size / slow / 1e6
            beside = [cell for c in others for cell in (u.size / c / 1e6, mine / c)]
            rows.append((name, speed, *beside, python_speed, speed / python_speed))
    unit = "M samples/s" if compiler() else "M samples/s, gcc not found: no C beside it"
    c_columns = [head for flags in FLAGS[: len(built)] for head in (" ".join(("C", *flags)), "time over it")]
    columns = ("loop", "ours", *c_columns, "Python + lfilter", "over Python")
    return Figures(f"Kernels, {u.size:.0e} samples, {unit}", columns, rows)


def sensitivities(samples: int) -> Figures:
    """Simulation of records, and the additional cost of all sensitivities."""
    data, rows = record(samples), []
    for name, effects in CHAINS.items():
        model = Model(effects, PERIOD)
        wanted = [n for n in model.values() if not model.row(n).fixed]
        speed, ratio = measure(model, data, wanted)
        rows.append((name, speed / 1e6, len(wanted), ratio))
    columns = ("chain", "M samples/s", "numbers", "value + sensitivities / value")
    return Figures(f"Sensitivities to every number, {samples:.0e} samples", columns, rows)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--samples", type=int, nargs="+", default=[1_000_000, 10_000_000])


def run(options: argparse.Namespace) -> list[Figures]:
    """One table for every size, and the sensitivities."""
    sizes: list[int] = options.samples
    return [*(compare(np.array(record(size).voltage)) for size in sizes), sensitivities(sizes[0])]


if __name__ == "__main__":
    alone(__name__)
