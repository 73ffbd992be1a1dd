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

"""Speed of the inverse, compared with a C loop of the same arithmetic, and latency of blocks."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.c_loops import ARRAY, compiler
from benchmarks.figures import Figures, seconds
from benchmarks.simulation import ARX, PERIOD
from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.effects import BoucWen, Creep, Effect, HysteresisMemory
from piezo_hysteresis.model.model import Model

SOURCE = Path(__file__).with_name("inverse_loops.c")
LIMITS = Limits(0.0, 10.0, 5e4)
"""Of the drive."""
CHAINS: dict[str, tuple[tuple[Effect, ...], float]] = {
    "Bouc-Wen + creep + ARX(8,8)": ((BoucWen(), Creep(gamma=0.0143), ARX), 1.0),
    "the same with 16 plays": ((BoucWen(), HysteresisMemory(c=(0.02,) * 16), Creep(gamma=0.0143), ARX), 2.0),
}
"""Chain to its effects and the time that was promised [µs per sample]."""
OVER_C = 1.3
"""Time over that of the C loop that was promised."""
RATE = 50e3
"""Samples per second at which the latency of blocks is judged."""


class InverseLoops:
    """The loops of inverse_loops.c, compiled in a folder."""

    def __init__(self, folder: Path) -> None:
        library = folder / "inverse_loops.so"
        flags = ("-O3", "-march=native", "-fPIC", "-shared")
        subprocess.run([str(compiler()), *flags, str(SOURCE), "-o", str(library), "-lm"], check=True)
        loaded = ctypes.CDLL(str(library))
        self._dynamics, self._invert = loaded.dynamics, loaded.invert
        size = ctypes.c_long
        self._dynamics.argtypes = [ARRAY, size, ARRAY, size, ARRAY, ARRAY]
        self._invert.argtypes = [
            *(ARRAY, size, ARRAY, ARRAY, ARRAY, size, ARRAY, ARRAY, ARRAY, ARRAY, size, ctypes.c_double),
            *(ARRAY, ARRAY, ARRAY, ARRAY),
        ]
        self._dynamics.restype = self._invert.restype = None

    def run(self, model: Model, inverse: Inverse, y: np.ndarray) -> np.ndarray:
        """Drive for a path from rest at 0 V, `inverse.preview` samples late."""
        (linear,) = (block.inverses[0] for _, block in inverse._stages if hasattr(block, "inverses"))
        part, taps, n = inverse._nonlinear, linear._padded, y.size
        p = np.array([model["bouc_wen"][k] for k in ("A", "beta", "gamma", "p1", "p2")])
        _, direct, fade, lead, weights, _ = part.bank
        limits = np.array([model.voltage_scale, LIMITS.voltage_min, LIMITS.voltage_max, LIMITS.max_slew_rate * PERIOD])
        targets, u, room = np.empty(n), np.empty(n), np.empty((2, fade.size))
        history = np.concatenate((np.zeros(taps.size - 1), y / model.displacement_scale))
        self._dynamics(history, n, taps, taps.size, linear._recursion, targets)
        count = part.radii.size
        c, radii = (values if count else np.zeros(1) for values in (part.weights[0].copy(), part.radii))
        self._invert(
            *(targets, n, p, c, radii, count, np.zeros(c.size)),
            *(fade, lead, weights, fade.size, float(direct[0]), limits, room[0], room[1], u),
        )
        return u


def path(size: int, model: Model) -> np.ndarray:
    """A slow large swing with a faster small one [m], that the drive can give."""
    t = np.arange(size) * PERIOD
    u = 3.0 * (1.0 - np.cos(2.0 * np.pi * 50.0 * t)) + 0.3 * (1.0 - np.cos(2.0 * np.pi * 430.0 * t))
    return model.run(u, model.rest(0.0))[0]


def speed(size: int) -> Figures:
    """Processor time per sample of `Inverse.run`, and over that of the C loop; the results are compared first."""
    rows, failures = [], []
    with tempfile.TemporaryDirectory() as folder:
        loops = InverseLoops(Path(folder)) if compiler() else None
        for name, (effects, promised) in CHAINS.items():
            model = Model(effects, PERIOD, 10.0, 1e-5)
            inverse = Inverse(model, LIMITS)
            y = path(size, model)

            def own(inverse: Inverse = inverse, y: np.ndarray = y) -> np.ndarray:
                return inverse.run(y, inverse.rest(0.0))[0]

            works = [own]
            if loops is not None:
                works.append(lambda model=model, inverse=inverse, y=y: loops.run(model, inverse, y))
                np.testing.assert_allclose(works[1](), own(), rtol=0.0, atol=1e-9)
            mine, *others = (1e6 * s / size for s in seconds(*works, repeats=7))
            ratio = mine / others[0] if others else None
            rows.append((name, mine, promised, others[0] if others else None, ratio))
            if mine > promised:
                failures.append(f"{name}: {mine:.2f} µs per sample, promised {promised:g}")
            if ratio is not None and ratio > OVER_C:
                failures.append(f"{name}: {ratio:.2f} times the C loop, promised {OVER_C:g}")
    columns = ("chain", "µs per sample", "promised", "C, µs per sample", "time over C")
    return Figures(f"Speed of the inverse, {size:.0e} samples, processor time", columns, rows, tuple(failures))


def blocks() -> Figures:
    """Time from a block of a path to its drive at 50 kHz, for which a node has to wait."""
    (effects, _), rows = CHAINS["the same with 16 plays"], []
    model = Model(effects, PERIOD, 10.0, 1e-5)
    inverse = Inverse(model, LIMITS)
    for size in (50, 500, 5000):
        y, state, spent = path(400 * size if size < 5000 else 40 * size, model), inverse.rest(0.0), []
        for start in range(0, y.size, size):
            begin = time.perf_counter()
            _, state = inverse.run(y[start : start + size], state)
            spent.append(time.perf_counter() - begin)
        late = np.percentile(1e3 * np.array(spent), [50, 99])
        rows.append((f"{size} samples, {1e3 * size / RATE:g} ms", float(late[0]), float(late[1])))
    return Figures(
        "Latency of blocks, Bouc-Wen + creep + ARX(8,8) + 16 plays", ("block", "median [ms]", "99 % [ms]"), rows
    )
