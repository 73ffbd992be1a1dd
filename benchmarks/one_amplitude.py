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

"""One rate and one amplitude: how well `identify` predicts others, and what the sizes of the prior have to do with it.

Stages with all numbers drawn are recorded as the measured piezo of `benchmarks.real_recordings`: a step from 0 V in the
first sample, then 35 cycles of one sine at 1 Hz, 200 samples a second. The zero wanders, and the sensor is noisy. Half
of the stages are those of `benchmarks.nanopositioner`; the others have a Preisach density that plays do not reproduce.
Growing, shrinking and climbing amplitudes, a faster and a slower rate are predicted, and compared without noise. The
whole is repeated with every size of `identification.structure.prior` halved and doubled, and with the true size of the
wander of every stage, which no estimate from the record could improve.

    python -m benchmarks.one_amplitude --stages 8
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from benchmarks.figures import Cell, Figures, alone
from benchmarks.nanopositioner import Nanopositioner
from piezo_hysteresis.blocks.kernel import kernel
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.structure import prior
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-3
"""Sample period [s]."""
CYCLES = 35
"""Number of cycles that are fitted."""
LEVELS = tuple(np.linspace(0.1, 1.0, 10).tolist())
"""Amplitudes that are predicted, as shares of the fitted one."""
RATES = (0.1, 5.0)
"""Rates that are predicted [Hz]."""
SIZES = ("SMOOTH", "LEVEL", "CURVE", "CREEP_SPREAD", "ONE_RATE", "WANDER")
"""Constants of `identification.structure.prior` that are halved and doubled."""
GRID = 160
"""Relays per axis of the Preisach plane."""
PROMISED = (0.6, 0.65)
"""Largest error on other amplitudes and on other rates that was promised [% of the fitted range]."""
LOWERED = 0.85
"""Promise: no size, halved or doubled, lowers the mean error (geometric, over the stages) below this share."""

Array = np.ndarray


@kernel
def relays(v, up, down, weights):
    """Σ of the weights of relays that are on; every relay was demagnetised around 0."""
    out = np.empty(v.size)
    on = up + down < 0.0
    total = 0.0
    last = np.inf
    for i in range(v.size):
        if v[i] != last:
            total = 0.0
            for k in range(up.size):
                on[k] = v[i] >= down[k] if on[k] else v[i] >= up[k]
                total += weights[k] * on[k]
            last = v[i]
        out[i] = total
    return out


class PreisachStage(Nanopositioner):
    """The same stage with relays instead of plays; their density depends on the width and on the level."""

    def _hysteresis(self, v: Array) -> Array:
        rng = np.random.default_rng(self.seed)
        edges = np.linspace(-1.02, 1.02, GRID)
        up, down = (axis[np.triu_indices(GRID, 1)] for axis in np.meshgrid(edges, edges, indexing="xy"))
        half, level = 0.5 * (up - down), 0.5 * (up + down)
        usual, spread = rng.uniform(0.08, 0.3), rng.uniform(0.5, 1.1)
        density = np.exp(-0.5 * (np.log(half / usual) / spread) ** 2) / (half + 0.02)
        density *= np.exp(-(((level - rng.uniform(0.2, 0.8)) / rng.uniform(0.4, 1.0)) ** 2))
        density /= density[down >= 0.0].sum()
        rest, *held = relays(np.append(0.0, v), up, down, density)
        held = np.array(held) - rest
        return np.asarray((1.0 - self.loop) * v + self.square * v**2 + self.cubic * v**3 + self.loop * held)


def waves(
    stage: Nanopositioner, levels: tuple[float, ...], frequency: float, cycles: int, middle: float = 0.5
) -> Array:
    """Cycles of every level around `middle`, which is a share of the range [V]."""
    phase = 2.0 * np.pi * frequency * PERIOD * np.arange(round(cycles / (frequency * PERIOD)))
    return stage.volt * np.concatenate([middle * (1.0 + level * np.sin(phase)) for level in levels])


def fitted(stage: Nanopositioner, wander: float, rng: np.random.Generator) -> Record:
    """The record of one amplitude; `wander` is that of the zero in 10 s, as a share of the stroke."""
    record = stage.play(waves(stage, (1.0,), 1.0, CYCLES), PERIOD)
    walk = np.cumsum(rng.normal(size=record.size)) * wander * np.sqrt(PERIOD / 10.0)
    return replace(record, displacement=record.displacement + stage.stroke * walk)


def percent(model: Model, record: Record, span: float) -> float:
    """Error in free run with one free constant [% of the fitted range]."""
    return float(100.0 * np.std(record.displacement - model.simulate(record)[0]) / span)


Played = tuple[Record, float, list[Record], list[Record]]
"""Fitted record of a stage, its wander, and the records of other amplitudes and of other rates."""


def stages(count: int, first: int) -> list[Played]:
    """Some stages; `first` is the seed of the first one."""
    found = []
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        kind = PreisachStage if seed % 2 else Nanopositioner
        lag = {"pole": float(rng.uniform(2e-3, 14e-3)), "delay": float(rng.uniform(1e-3, 6e-3))}
        noise = float(np.exp(rng.uniform(np.log(2e-4), np.log(1e-3))))
        stage = kind.random(rng, mode=float(rng.uniform(300.0, 900.0)), noise=noise, **lag)
        wander = float(rng.uniform(0.001, 0.004))
        known = fitted(stage, wander, rng)
        quiet = replace(stage, noise=0.0)
        climbing = np.concatenate([waves(stage, (1.0,), 1.0, 1, 0.5 * level) for level in LEVELS])
        amplitudes = [waves(stage, LEVELS, 1.0, 2), waves(stage, LEVELS[::-1], 1.0, 2), climbing]
        rates = [waves(stage, (1.0,), f, max(2, round(4.0 * f))) for f in RATES]
        found.append((known, wander, *([quiet.play(u, PERIOD) for u in part] for part in (amplitudes, rates))))
    return found


def errors_of(played: list[Played], *, true_wander: bool = False) -> Array:
    """Errors of every stage, other amplitudes and other rates: (n, 2) [%]."""
    found = []
    for known, wander, *others in played:
        with patch.object(prior, "WANDER", wander if true_wander else prior.WANDER):
            model = identify(Experiment((known,)), memory=True).model
        span = float(np.ptp(known.displacement))
        found.append([float(np.mean([percent(model, r, span) for r in part])) for part in others])
    return np.array(found)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Number of stages."""
    parser.add_argument("--stages", type=int, default=8)
    parser.add_argument("--first", type=int, default=0, help="seed of the first stage")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row per size of the prior."""
    played = stages(options.stages, options.first)
    usual = errors_of(played)
    true = errors_of(played, true_wander=True)
    rows: list[tuple[Cell, ...]] = [("as it is", *_row(usual, usual)), ("WANDER as it was", *_row(true, usual))]
    failures = [
        f"{what}: got {error:.3g} %, promised at most {most:g} %"
        for what, error, most in zip(("amplitudes", "rates"), usual.max(axis=0), PROMISED, strict=True)
        if error > most
    ]
    for name in SIZES:
        for factor in (0.5, 2.0):
            with patch.object(prior, name, factor * getattr(prior, name)):
                found = errors_of(played)
            rows.append((f"{name} × {factor:g}", *_row(found, usual)))
            ratio = float(np.exp(np.log(found / usual).mean()))
            if ratio < LOWERED:
                failures.append(f"{name} × {factor:g}: the error is {ratio:.2f} times the usual one")
    columns = ("prior", "amplitudes: median", "largest", "ratio", "rates: median", "largest", "ratio")
    title = "Free-run error on amplitudes and rates that were not fitted, % of range"
    return [Figures(title, columns, rows, tuple(failures))]


def _row(errors: Array, usual: Array) -> tuple[float, ...]:
    """Median, largest, and geometric mean of the ratio, of both columns."""
    ratio = np.exp(np.log(errors / usual).mean(axis=0))
    parts = zip(np.median(errors, axis=0), errors.max(axis=0), ratio, strict=True)
    return tuple(float(number) for part in parts for number in part)


if __name__ == "__main__":
    alone(__name__)
