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

"""Exported C code compared with the Python kernels: time per sample, deviation, and memory.

Prediction and inverse of three chains, by gcc -O2 with and without the fused multiply-add that the kernels use. The
functions are called as a block; processor time of one core, warm.

    python -m benchmarks.export
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.ctypeslib import ndpointer

from benchmarks.c_loops import compiler
from benchmarks.figures import Cell, Figures, alone, seconds
from benchmarks.simulation import ARX, PERIOD, record
from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.effects import Arx, BoucWen, Creep, Effect, HysteresisMemory, Offset, PublishedBoucWen
from piezo_hysteresis.export import c_program
from piezo_hysteresis.model.model import Model

ARRAY = ndpointer(np.float64, flags="C_CONTIGUOUS")
"""Argument of the block functions."""
STAGE = Arx(a=[-1.2, 0.6], b=[0.05, 0.1, 0.05 / 3], delay=2)
"""Dynamics with an exact inverse."""
CHAINS: dict[str, tuple[Effect, ...]] = {
    "published step + delay + ARX(8,8)": (PublishedBoucWen(), ARX),
    "exact step + ARX(2,3)": (BoucWen(), STAGE),
    "exact step + 8 plays + creep + ARX(2,3) + offset": (
        BoucWen(),
        HysteresisMemory(c=(0.02,) * 8),
        Creep(gamma=0.012),
        STAGE,
        Offset(y0=1e-7),
    ),
}
"""What is exported."""
FLAGS = (("-O2",), ("-O2", "-mfma"))
"""Of gcc."""
WORST = 1e-12
"""Promise: largest deviation of the prediction, as a share of the largest displacement."""


class CModel:
    """The block functions of an exported program, compiled."""

    def __init__(self, model: Model, inverse: Inverse, folder: Path, flags: tuple[str, ...]) -> None:
        for name, text in c_program(model, "piezo", inverse).items():
            (folder / name).write_text(text)
        library = folder / f"lib{''.join(flags)}.so"
        command = [str(compiler()), "-std=c99", *flags, "-fPIC", "-shared", "piezo.c", "-lm", "-o", str(library)]
        subprocess.run(command, check=True, cwd=folder)
        self._loaded = ctypes.CDLL(str(library))

    def size(self, part: str = "") -> int:
        """Of the state [bytes]."""
        return int(self._loaded[f"piezo_{part}state_size"]())

    def work(self, x: np.ndarray, start: float, part: str = "") -> Callable[[], np.ndarray]:
        """Prediction, or another `part`, of a whole block from rest at `start` [V]."""
        reset, run = self._loaded[f"piezo_{part}reset"], self._loaded[f"piezo_{part}run"]
        reset.argtypes, run.argtypes = (
            [ctypes.c_void_p, ctypes.c_double],
            [ctypes.c_void_p, ARRAY, ARRAY, ctypes.c_size_t],
        )
        state, y = ctypes.create_string_buffer(self.size(part)), np.empty_like(x)

        def call() -> np.ndarray:
            reset(state, start)
            run(state, x, y, x.size)
            return y

        return call


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--samples", type=int, default=200_000)


def run(options: argparse.Namespace) -> list[Figures]:
    """One table: every chain, prediction and inverse."""
    columns = ("chain", "Python, ns per sample", *(f"C {' '.join(f)}, ns" for f in FLAGS),
               *(f"deviation, {' '.join(f)}" for f in FLAGS), "state, bytes")  # fmt: skip
    title = f"Exported C code, {options.samples:.0e} samples; deviations as a share of the largest output"
    if compiler() is None:
        return [Figures(f"{title}: gcc not found", columns, [])]
    u = np.array(record(options.samples).voltage)
    rows: list[tuple[Cell, ...]] = []
    failures = []
    for name, effects in CHAINS.items():
        model = Model(effects, PERIOD, 10.0, 1e-5)
        inverse, start = Inverse(model, Limits(0.0, 10.0)), float(u[0])
        path, _ = model.run(u, model.rest(start))
        parts: dict[str, tuple[np.ndarray, Callable[[], np.ndarray]]] = {
            "": (u, lambda m=model, s=start: m.run(u, m.rest(s))[0]),
            "inverse_": (path, lambda i=inverse, s=start, y=path: i.run(y, i.rest(s))[0]),
        }
        with tempfile.TemporaryDirectory() as folder:
            built = [CModel(model, inverse, Path(folder), flags) for flags in FLAGS]
            for part, (x, own) in parts.items():
                peers = [c.work(x, start, part) for c in built]
                expected = own()
                off = [float(np.abs(peer() - expected).max() / np.abs(expected).max()) for peer in peers]
                if not part and max(off) > WORST:
                    failures.append(f"{name}: deviation {max(off):.3g}, expected at most {WORST:g}")
                times = [1e9 * t / x.size for t in seconds(own, *peers)]
                rows.append((f"{name}{', inverse' if part else ''}", *times, *off, built[0].size(part)))
    return [Figures(title, columns, rows, tuple(failures))]


if __name__ == "__main__":
    alone(__name__)
