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

"""Cases of the naming benchmark: the hidden effects, the stage, the noise, and the right answer."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.independent_plant import Plant
from benchmarks.naming_experiments import PackagedPlant, ProtocolVariant, poor, rich
from piezo_hysteresis.effects import BY_NAME, CATALOGUE, Effect
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.stage.hidden import hidden_effect
from piezo_hysteresis.stage.plant import PlantParameters

NOISES = (1e-4, 5e-4, 2e-3)
"""Of the stroke, rms per sample at the fastest period."""
EFFECTS = tuple(dict.fromkeys(e.public_name() for e in CATALOGUE))
"""Public names of the catalogue."""
GROUPS = ("effect_free", "effects", "pairs", "uncatalogued", "absent", "plays", "plays_beside_loop", "poor")


@dataclass(frozen=True)
class Case:
    """One experiment with a known answer.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    truth : tuple of str
        Effects hidden, by their public names; empty for none.
    seed : int
        Of the plant, the sizes, the drive and the noise.
    noise : float
        Of the stroke, rms per sample.
    plant : str
        ``independent``, ``thorough`` (the same with full dynamics in slow phases), ``explicit`` (``thorough`` with the
        explicit step of Eq. (7), without terms of the loop) or ``packaged``.
    layout : ProtocolVariant
        Of the experiment.
    without : tuple of str
        Families taken out of the library.
    extra : mapping
        Further things hidden in the independent plant.
    """

    group: str
    truth: tuple[str, ...]
    seed: int
    noise: float
    plant: str = "independent"
    layout: ProtocolVariant = field(default_factory=ProtocolVariant)
    without: tuple[str, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def label(self) -> str:
        """One word for tables."""
        what = "+".join((*self.truth, *self.extra.get("unknown_name", ()))) or "nothing"
        return f"{self.group}/{what}"

    @property
    def library(self) -> tuple[type[Effect], ...]:
        """Effects from which the gap finder may choose."""
        return tuple(e for e in CATALOGUE if e.family not in self.without)

    @property
    def nameable(self) -> frozenset[str]:
        """Families that a right answer names."""
        if self.group in ("absent", "uncatalogued"):
            return frozenset()
        return frozenset(BY_NAME[n].family for n in self.truth)

    def player(self) -> tuple[Plant | PackagedPlant, int]:
        """The stage, and the seed of its drive."""
        rng = np.random.default_rng([self.seed, zlib.crc32(self.label.encode())])
        seed = int(rng.integers(1 << 31))
        if self.plant == "packaged":
            return PackagedPlant(_packaged(self, seed), seed), seed
        hidden = {n: _draw(n, rng) for n in self.truth}
        plays = self.group == "plays"
        if plays:
            hidden.pop("hysteresis_memory", None)
        plant = Plant.random(
            rng,
            noise=self.noise,
            plays=plays,
            volt=float(rng.choice([1.0, 10.0, 125.0])),
            hidden={**hidden, **self.extra},
            thorough=self.plant in ("thorough", "explicit"),
            explicit=self.plant == "explicit",
        )
        return plant, seed

    def experiment(self) -> Experiment:
        """The recorded data."""
        player, seed = self.player()
        return poor(player, seed) if self.group == "poor" else rich(player, seed, self.layout)


QUICK = (
    "creep",
    "thermal_drift",
    "gain_drift",
    "asymmetric_hysteresis",
    "hysteresis_exponent",
    "hysteresis_memory",
    "rate_dependent_hysteresis",
    "initial_state",
    "backlash",
    "softening",
    "amplifier_slew_limit",
    "amplifier_saturation",
    "sensor_nonlinearity",
    "mains_hum",
    "axis_coupling",
)
"""Effects of the group ``quick``, which is run after every change of the rules."""
EFFECT_FREE = 12
"""Stages without an effect in that group."""


def cases(groups: tuple[str, ...], seeds: int, noises: tuple[float, ...] = NOISES) -> Iterator[Case]:
    """Every effect × `seeds` × `noises` on both plants, and the other groups in proportion."""
    makers = {
        "effect_free": _effect_free,
        "effects": _effects,
        "pairs": _pairs,
        "uncatalogued": _uncatalogued,
        "absent": _absent,
        "plays": _plays,
        "plays_beside_loop": _plays_beside_loop,
        "poor": _poor,
        "quick": _quick,
        "explicit": _explicit,
    }
    for group in groups:
        yield from makers[group](seeds, noises)


LAYOUTS = (
    ProtocolVariant(),
    ProtocolVariant(shift=-4.0),
    ProtocolVariant(slowest=0.1),
    ProtocolVariant(hold=10.0, with_steps=False),
)


def _effect_free(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    for k in range(60 * seeds):
        plant = ("independent", "thorough", "independent", "packaged")[k % 4]
        layout = LAYOUTS[0] if plant == "packaged" else LAYOUTS[(k // len(noises)) % 4]
        yield Case("effect_free", (), k, noises[k % len(noises)], plant, layout)


def _effects(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    for seed in range(seeds):
        for k, name in enumerate(EFFECTS):
            for j, noise in enumerate(noises):
                plant = ("independent", "thorough", "packaged")[(seed + k + j) % 3]
                yield Case("effects", (name,), seed, noise, plant)


def _pairs(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    """Pairs of a random order of the catalogue: every effect occurs once per seed."""
    for seed in range(seeds):
        order = np.random.default_rng(seed).permutation(EFFECTS).tolist()
        for k, pair in enumerate(zip(order[::2], order[1::2], strict=False)):
            yield Case("pairs", pair, seed, noises[(k + seed) % len(noises)])


def _interpolation(plant: Plant, u: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Periodic error of an interferometer or encoder."""
    return y + 0.004 * plant.stroke * np.sin(2 * np.pi * y / (0.07 * plant.stroke))


def _line(plant: Plant, u: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A line that is no mains frequency."""
    return y + 0.004 * plant.stroke * np.sin(2 * np.pi * 137.3 * t + t[0])


def _telegraph(plant: Plant, u: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A sensor that jumps between two zeros."""
    return y + 0.004 * plant.stroke * np.sign(np.sin(2 * np.pi * 0.61 * t * (1 + 0.3 * np.sin(0.37 * t))))


def _breathing_gain(plant: Plant, u: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Gain that goes up and down."""
    return y * (1 + 0.006 * np.sin(2 * np.pi * 0.23 * t))


def _wander(plant: Plant, u: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Random walk of the mounting, apart from the drive."""
    walk = np.cumsum(np.random.default_rng(y.size).normal(size=y.size)) * np.sqrt((t[1] - t[0]) / 3.0)
    return y + 0.006 * plant.stroke * (walk - walk[0])


UNKNOWN = {f.__name__.strip("_"): f for f in (_interpolation, _line, _telegraph, _breathing_gain, _wander)}
"""Effects that are not in the catalogue."""


def _uncatalogued(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    for seed in range(2 * seeds):
        for k, (name, effect) in enumerate(UNKNOWN.items()):
            extra = {"unknown": effect, "unknown_name": (name,)}
            yield Case("uncatalogued", (), seed, noises[(k + seed) % len(noises)], extra=extra)


def _absent(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    for k, case in enumerate(_effects(seeds, (noises[min(1, len(noises) - 1)],))):
        if k % 2 == 0 or seeds > 1:
            yield replace(case, group="absent", without=(BY_NAME[case.truth[0]].family,))


def _plays(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    partners = ((), ("creep",), ("thermal_drift",), ("extra_resonance",), ("mains_hum",), ("amplifier_slew_limit",))
    for seed in range(seeds):
        for k, partner in enumerate(partners):
            yield Case("plays", ("hysteresis_memory", *partner), seed, noises[(k + seed) % len(noises)])


def _plays_beside_loop(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    """Plays beside a Bouc-Wen loop, from hardly visible ones to ones that are larger than the loop."""
    for seed in range(seeds):
        for size in (0.05, 0.5, 5.0):
            for noise in noises:
                extra = {"hysteresis_memory": size}
                yield Case("plays_beside_loop", ("hysteresis_memory",), seed, noise, extra=extra)


def _poor(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    hidden = ((), (), ("creep",), ("rate_dependent_hysteresis",), ("amplifier_slew_limit",), ("mains_hum",))
    for seed in range(seeds):
        for k, truth in enumerate(hidden):
            yield Case("poor", truth, seed + 10 * k, noises[(k + seed) % len(noises)])


def _quick(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    """Cases of the groups ``effects`` and ``effect_free``."""
    for seed in range(seeds):
        for k, name in enumerate(QUICK):
            yield Case(
                "effects", (name,), seed, noises[len(noises) // 2], ("independent", "thorough", "packaged")[k % 3]
            )
    yield from list(_effect_free(seeds, noises))[: EFFECT_FREE * seeds]


def _packaged(case: Case, seed: int) -> PlantParameters:
    base = PlantParameters().with_values({"sensor.noise": case.noise})
    for k, name in enumerate(case.truth):
        base = hidden_effect(seed + k, base, name=name, highest_voltage=8.0).parameters
    return base


def _draw(name: str, rng: np.random.Generator) -> Any:
    """Size of an effect in the independent plant: large enough to be visible, small enough to be realistic."""

    def size(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def signed(low: float, high: float) -> float:
        return float(rng.choice([-1.0, 1.0])) * size(low, high)

    one = {
        "even_input_polynomial": lambda: signed(0.03, 0.1),
        "hysteresis_exponent": lambda: rng.uniform(1.15, 1.8),
        "hysteresis_memory": lambda: size(0.005, 0.02),
        "initial_state": lambda: signed(0.03, 0.1),
        "backlash": lambda: size(0.001, 0.005),
        "extra_delay": lambda: size(5e-6, 1.5e-5),
        "amplifier_bandwidth": lambda: size(1.5e-5, 6e-5),
        "sensor_bandwidth": lambda: size(2e-5, 3e-4),
        "amplifier_slew_limit": lambda: size(300.0, 700.0),
        "axis_coupling": lambda: signed(0.005, 0.012),
    }
    several = {
        "creep": lambda: (str(rng.choice(["logarithmic", "fractional", "exponential"])), size(0.006, 0.02)),
        "thermal_drift": lambda: (signed(0.004, 0.03), size(40.0, 200.0)),
        "gain_drift": lambda: (signed(0.005, 0.02), size(40.0, 200.0)),
        "asymmetric_hysteresis": lambda: (signed(0.4, 1.0), signed(0.4, 1.0)),
        "rate_dependent_hysteresis": lambda: (size(0.02, 0.06), rng.uniform(0.1, 0.4)),
        "softening": lambda: (signed(0.01, 0.04), signed(0.01, 0.04)),
        "amplifier_saturation": lambda: (rng.uniform(0.68, 0.77), size(0.005, 0.02)),
        "extra_resonance": lambda: (size(300.0, 2500.0), size(0.005, 0.03), size(0.02, 0.08)),
        "sensor_nonlinearity": lambda: (signed(0.002, 0.01), signed(0.002, 0.01)),
        "mains_hum": lambda: (float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05)), size(1e-3, 5e-3)),
    }
    return {**one, **several}[name]()


def _explicit(seeds: int, noises: tuple[float, ...]) -> Iterator[Case]:
    """Cases of the groups ``effects`` and ``effect_free``, as a simulation with the explicit step gives them."""
    for seed in range(seeds):
        yield Case("effect_free", (), seed, noises[len(noises) // 2], "explicit")
        for name in ("creep", "initial_state", "sensor_nonlinearity", "thermal_drift", "backlash"):
            yield Case("effects", (name,), seed, noises[len(noises) // 2], "explicit")
