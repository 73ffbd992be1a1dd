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

"""Speed of simulation and of sensitivities: the chain, and every effect of the catalogue added to it.

Processor time of one core, after warm-up, over a drive that fits in no cache.

    python -m benchmarks.simulation
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.figures import Cell, Figures, alone, seconds
from piezo_hysteresis.effects import CATALOGUE, Arx, BoucWen, Effect
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

ARX = Arx(
    a=[-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198],
    b=[0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408],
    delay=3,
)
PERIOD = 2e-5


def record(size: int) -> Record:
    """Large slow sine with a little noise, every channel filled."""
    voltage = 3.5 + 2.5 * np.sin(np.arange(size) * 2e-3) + np.random.default_rng(0).normal(scale=0.01, size=size)
    zero = np.zeros(size)
    return Record(voltage, zero, PERIOD, channels={"other_displacement": zero, "temperature": zero + 293.15})


def measure(model: Model, data: Record, wanted: list[str]) -> tuple[float, float]:
    """Samples per second of the simulation, and the cost of its sensitivities as a multiple of it."""
    value, slopes = seconds(
        lambda: model.simulate(data), lambda: [None for _ in model.linearise([data], wanted)], repeats=3
    )
    return data.size / value, slopes / value


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--samples", type=int, default=200_000)


def run(options: argparse.Namespace) -> list[Figures]:
    """Every effect, added to the chain of the exact step."""
    data = record(options.samples)
    rows: list[tuple[Cell, ...]] = []

    def row(name: str, *effects: Effect) -> None:
        model = Model(effects, PERIOD)
        wanted = [n for n in model.values() if not model.row(n).fixed]
        speed, ratio = measure(model, data, wanted)
        rows.append((name, speed / 1e6, len(wanted), ratio))

    row("bouc_wen, arx", BoucWen(), ARX)
    for kind in CATALOGUE:
        on = {
            p.name: p.off - p.scale if p.off == p.upper else p.off + p.scale
            for p in kind.parameters
            if p.off is not None
        }
        arrays = {p.name: (on[p.name],) * len(p.value) for p in kind.parameters if p.name in on and p.is_array}
        row(f"… with {kind.name}", BoucWen(), ARX, kind(**{**on, **arrays}))
    columns = ("chain", "M samples/s", "numbers", "value + sensitivities / value")
    return [Figures(f"Every effect of the catalogue, {data.size:.0e} samples", columns, rows)]


if __name__ == "__main__":
    alone(__name__)
