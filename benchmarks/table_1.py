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

"""The paper's own gap: which effect, missing from the published model, would produce both rows of its Table 1?

The stage is taken as the published model with one more effect. Two models predict its sines 3.5 + 2.5 sin(2πft) V: the
published cascade, and the hysteresis alone times the dc gain of G. The five numbers of the loop were fitted at 1 Hz, so
the part of the effect that they can imitate at 1 Hz is removed, to first order. The error, RMS over peak-to-peak, is
added in quadrature to the 0.90 % that both rows show at 1 Hz, and the numbers of the effect are fitted to the twelve
published percentages.

    python -m benchmarks.table_1
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from benchmarks.figures import Cell, Figures, alone
from piezo_hysteresis.effects import (
    AmplifierBandwidth,
    AmplifierSlewLimit,
    Arx,
    BoucWen,
    Creep,
    CreepExponential,
    CreepFractional,
    Effect,
    ExtraResonance,
    RateDependentHysteresis,
    SensorBandwidth,
    Softening,
)
from piezo_hysteresis.effects.material.creep_exponential import FASTEST
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

FREQUENCIES = (1, 50, 100, 200, 300, 400)
"""Paper, Table 1 [Hz]."""
DYNAMIC = (0.90, 1.80, 2.39, 3.30, 3.54, 4.02)
"""Error of the Hammerstein model [%]."""
ALONE = (0.90, 2.29, 3.60, 5.95, 7.98, 10.79)
"""Error of MBW alone [%]."""
BASE = 0.90
"""What both rows show at 1 Hz [%]."""
PERIOD = 2e-5
LOOP = BoucWen(A=-0.7691, beta=4.6075, gamma=-0.8725, p1=-0.1085, p2=2.1925)
DYNAMICS = Arx(
    a=[-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198],
    b=[0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408],
    delay=3,
)


@dataclass(frozen=True)
class Suspect:
    """An effect with its free numbers.

    Parameters
    ----------
    name : str
        In words.
    make : callable
        Effect for the free numbers, or None for the published model.
    start, low, high : tuple of float
        Of the free numbers.
    trim : bool
        Whether the delay of the stage may differ from the published 60 µs, by less than two samples.
    """

    name: str
    make: Callable[..., Effect] | None
    start: tuple[float, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    trim: bool = False


@dataclass(frozen=True)
class Explanation:
    """A suspect with its numbers fitted, and the two rows it predicts [%]."""

    suspect: Suspect
    numbers: np.ndarray
    dynamic: np.ndarray
    alone: np.ndarray

    @property
    def misfit(self) -> float:
        """RMS over the twelve numbers [percentage points]."""
        return float(np.sqrt(np.mean(np.concatenate((self.dynamic - DYNAMIC, self.alone - ALONE)) ** 2)))


FASTEST_DECADE = float(np.log10(FASTEST))
"""Of the time constant of an element; a faster one counts as dynamics."""
BANK = {"tau_min": PERIOD, "tau_max": 100.0}
SINGLE = (
    Suspect("nothing", None),
    Suspect("creep, logarithmic", lambda g: Creep(gamma=g, **BANK), (0.01,), (0.0,), (0.1,)),
    Suspect(
        "creep, power law",
        lambda g, e: CreepFractional(gamma=g, exponent=e, **BANK),
        (0.02, -0.05),
        (0, -0.5),
        (0.15, 0.5),
    ),
    Suspect(
        "creep, two Kelvin-Voigt elements",
        lambda a, b, s, t: CreepExponential(c=[a, b], tau=[10.0**s, 10.0**t]),
        (0.02, 0.02, -2.0, -0.5),
        (0.0, 0.0, FASTEST_DECADE, -1.5),
        (0.2, 0.2, -1.5, 1.0),
    ),
    Suspect(
        "rate_dependent_hysteresis",
        lambda k, a: RateDependentHysteresis(k=k, a=a),
        (0.03, 0.1),
        (-0.2, 0.02),
        (0.3, 1.0),
    ),
    Suspect("amplifier_bandwidth", lambda t: AmplifierBandwidth(tau=t), (2e-5,), (0.0,), (2e-4,)),
    Suspect("sensor_bandwidth", lambda t: SensorBandwidth(tau=t), (2e-5,), (0.0,), (2e-4,)),
    Suspect("amplifier_slew_limit", lambda s: AmplifierSlewLimit(S=s), (5500.0,), (2000.0,), (7000.0,)),
    Suspect("extra_resonance", lambda f, r: ExtraResonance(f0=f, r=r), (800.0, 0.05), (450.0, -0.3), (3000.0, 0.3)),
    Suspect("softening", lambda p, q: Softening(k2=p, k3=q), (0.02, 0.02), (-0.2, -0.2), (0.2, 0.2)),
)


def suspects() -> tuple[Suspect, ...]:
    """Every suspect by itself, and together with a delay trim."""
    trimmed = tuple(
        Suspect(f"{s.name} + delay trim" if s.make else "extra_delay", s.make, s.start, s.low, s.high, True)
        for s in SINGLE
    )
    return SINGLE + trimmed


def drive(frequency: float) -> np.ndarray:
    """Sine of Table 1 from its mean: four periods, or a twentieth of a second."""
    duration = max(4, frequency // 20) / frequency
    return 3.5 + 2.5 * np.sin(2 * np.pi * frequency * np.arange(0, duration, PERIOD))


@dataclass(frozen=True)
class Prediction:
    """What a model answers over the last periods of every sine, and how the numbers of its loop change that."""

    outputs: list[np.ndarray]
    slopes: list[np.ndarray]


def answers(*effects: Effect) -> list[np.ndarray]:
    """Displacement over the last two periods of every sine [normalised], mean removed."""
    model = Model(effects, PERIOD)
    outputs = []
    for f in FREQUENCIES:
        u = drive(f)
        (y,) = model.simulate(Record(u, np.zeros(u.size), PERIOD))
        outputs.append(_settled(y, f))
    return outputs


def predict(gain: float, *effects: Effect) -> Prediction:
    """A published model, its output times `gain`."""
    model, slopes = Model(effects, PERIOD), []
    wanted = [f"bouc_wen.{n}" for n in ("A", "beta", "gamma", "p1", "p2")]
    for f in FREQUENCIES:
        u = drive(f)
        _, own = model.sensitivities(Record(u, np.zeros(u.size), PERIOD), wanted)
        slopes.append(np.array([gain * _settled(own[n], f) for n in wanted]))
    return Prediction([gain * y for y in answers(*effects)], slopes)


def _settled(y: np.ndarray, frequency: float) -> np.ndarray:
    last = y[-round(2 / frequency / PERIOD) :]
    return last - last.mean()


def row(stage: list[np.ndarray], model: Prediction) -> np.ndarray:
    """Errors of a model whose loop was fitted to the stage at 1 Hz [%], with the base in quadrature."""
    step = np.linalg.lstsq(model.slopes[0].T, stage[0] - model.outputs[0], rcond=None)[0]
    errors = [
        100 * float(np.std(y - m - step @ slopes) / np.ptp(y))
        for y, m, slopes in zip(stage, model.outputs, model.slopes, strict=True)
    ]
    return np.hypot(BASE, errors)


def late(signals: list[np.ndarray], delay: float) -> list[np.ndarray]:
    """Periodic signals, shifted by a delay of either sign [s]."""
    shifted = []
    for y in signals:
        line = np.fft.rfftfreq(y.size, PERIOD)
        shifted.append(np.fft.irfft(np.fft.rfft(y) * np.exp(-2j * np.pi * line * delay), y.size))
    return shifted


def explain(suspect: Suspect) -> Explanation:
    """Fit the numbers of a suspect to both rows."""
    published, alone = predict(1.0, LOOP, DYNAMICS), predict(DYNAMICS.dc_gain, LOOP)

    def rows(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = numbers[: len(suspect.start)]
        stage = answers(LOOP, DYNAMICS, suspect.make(*own)) if suspect.make else published.outputs
        if suspect.trim:
            stage = late(stage, 1e-6 * numbers[-1])
        return row(stage, published), row(stage, alone)

    def misfit(numbers: np.ndarray) -> np.ndarray:
        try:
            dynamic, static = rows(numbers)
        except DivergenceError:
            return np.full(2 * len(FREQUENCIES), 100.0)
        return np.concatenate((dynamic - DYNAMIC, static - ALONE))

    start = np.array([*suspect.start, *([5.0] if suspect.trim else [])], float)
    if not start.size:
        return Explanation(suspect, start, *rows(start))
    low = np.array([*suspect.low, *([-40.0] if suspect.trim else [])], float)
    high = np.array([*suspect.high, *([40.0] if suspect.trim else [])], float)
    found = least_squares(misfit, start, bounds=(low, high), x_scale=np.abs(start), diff_step=1e-3, max_nfev=40)
    return Explanation(suspect, found.x, *rows(found.x))


def arguments(parser: argparse.ArgumentParser) -> None:
    """No options."""


def run(options: argparse.Namespace) -> list[Figures]:
    """The ranking."""
    ranked = sorted((explain(s) for s in suspects()), key=lambda e: e.misfit)
    rows: list[tuple[Cell, ...]] = [
        ("(published)", "", None, "dynamic", *map(float, DYNAMIC)),
        ("", "", None, "alone", *map(float, ALONE)),
    ]
    for e in ranked:
        numbers = ", ".join(f"{x:.3g}" for x in e.numbers[: len(e.suspect.start)])
        if e.suspect.trim:
            numbers += f"{', ' if numbers else ''}{e.numbers[-1]:+.1f} µs"
        rows.append((e.suspect.name, numbers, e.misfit, "dynamic", *e.dynamic.tolist()))
        rows.append(("", "", None, "alone", *e.alone.tolist()))
    heads = (f"{f} Hz" for f in FREQUENCIES)
    columns = ("missing effect", "numbers", "misfit, points", "row", *heads)
    return [Figures("Both rows of Table 1, %", columns, rows)]


if __name__ == "__main__":
    alone(__name__)
