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

"""One protocol on one plant, played directly and through a back end: the answers must be the same within the noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from piezo_hysteresis.discrepancy import Diagnosis, diagnose
from piezo_hysteresis.effects import BY_NAME, CATALOGUE, Arx
from piezo_hysteresis.identification import DriveLimits, Identification, identify
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 2e-4
SIGMAS = 4.5
"""Of about twenty numbers that are compared, none is further off by chance but once in ten thousand runs."""

PLAIN = PlantParameters()
CREEPING = PlantParameters.from_mapping({"creep.gamma": 0.015})
NOISE = PLAIN.sensor.noise * PLAIN.full_stroke
LIBRARY = tuple(BY_NAME[name] for name in ("creep", "thermal_drift", "gain_drift"))

_LIMITS = DriveLimits(sample_period=PERIOD)
_BODIES = (
    ("step", excitation.steps(_LIMITS, (0.2, 0.6, 0.3, 0.8) * 3, 0.01)),
    ("noise", excitation.noise(_LIMITS, 0.03, 2e3, 0.5, 0.35, 1)),
    ("noise", excitation.noise(_LIMITS, 0.03, 2e3, 0.5, 0.35, 2)),
    ("triangle", excitation.triangle(_LIMITS, (1.0, 0.75, 0.5, 0.25), 4.0)),
    ("staircase", excitation.steps(_LIMITS, (0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0), 0.5, slew_rate=50.0)),
    ("minor_loops", excitation.ramps(_LIMITS, excitation.nested_loops(0.45, 4), 50.0)),
    ("triangle", excitation.triangle(_LIMITS, (1.0, 0.5), 4.0)),
    ("validation", excitation.mixture(_LIMITS, 0.5, 9)),
)
PHASES = tuple((name, _LIMITS.from_safe_to_safe(body)) for name, body in _BODIES)

Played = list[tuple[np.ndarray, np.ndarray]]
"""Voltage [V] and displacement [m] of every phase."""


def recorded(play: Callable[[list[np.ndarray]], Played]) -> Experiment:
    """The protocol as an experiment; `play` takes the drives of all phases, one following the other."""
    records, clock = [], 0.0
    played = play([drive for _, drive in PHASES])
    for (name, drive), (voltage, displacement) in zip(PHASES, played, strict=True):
        records.append(Record(voltage, displacement, PERIOD, name, clock, continues=bool(records)))
        clock += drive.size * PERIOD
    return Experiment(tuple(records))


@cache
def direct(plant: PlantParameters, seed: int) -> Experiment:
    """The protocol on the simulated stage itself."""
    stage = SimulatedStage(plant, seed=seed, sample_period=PERIOD)

    def play(drives: list[np.ndarray]) -> Played:
        records = [stage.play(drive, continues=True) for drive in drives]
        return [(record.voltage, record.displacement) for record in records]

    return recorded(play)


def identified(experiment: Experiment) -> Identification:
    """With fixed scales, so that numbers can be compared."""
    scales = {"voltage_scale": 10.0, "displacement_scale": PLAIN.full_stroke}
    return identify(experiment, orders=(3, 3), **scales)


@cache
def reference(plant: PlantParameters, seed: int) -> Identification:
    return identified(direct(plant, seed))


@cache
def diagnosed(plant: PlantParameters, seed: int, whole: bool = False) -> Diagnosis:
    return gap_found(direct(plant, seed), whole)


def gap_found(experiment: Experiment, whole: bool = False) -> Diagnosis:
    """What the model of the plain stage misses, out of three effects or of the whole catalogue."""
    return diagnose(experiment, reference(PLAIN, 1).model, effects=CATALOGUE if whole else LIBRARY)


@dataclass(frozen=True)
class Departure:
    """How far two identifications of the same stage lie apart, in standard errors of the difference."""

    parameters: dict[str, float]
    response: np.ndarray
    free_run: dict[str, float]


def departure(one: Identification, other: Identification) -> Departure:
    """Parameters and frequency response against the covariances of both fits, free-run errors against their scatter."""
    a, b = one.fit, other.fit
    errors = {n: np.hypot(a.standard_errors[n], b.standard_errors[n]) for n in a.names}
    parameters = {n: abs(a.values[n] - b.values[n]) / errors[n] for n in a.names}
    (response_a, spread_a), (response_b, spread_b) = _response(one), _response(other)
    response = np.abs(response_a - response_b) / np.hypot(spread_a, spread_b)
    free_run = {
        f"{p.phase} {i}": abs(p.rms - q.rms) / (p.rms * np.sqrt(2.0 / min(record.size for record in direct(PLAIN, 1))))
        for i, (p, q) in enumerate(zip(one.phases, other.phases, strict=True))
    }
    return Departure(parameters, response, free_run)


def _response(found: Identification) -> tuple[np.ndarray, np.ndarray]:
    """G up to 0.4 of the sampling rate, and its standard error, from the covariance of the fit."""
    frequency = np.geomspace(1.0, 0.4 / PERIOD, 30)
    fit = found.fit
    arx, order = fit.model[Arx.name], [n for n in fit.names if n.startswith("arx.")]

    def response(changed: str = "", by: float = 0.0) -> np.ndarray:
        a, b = ([v + by * (changed == f"arx.{k}[{i}]") for i, v in enumerate(arx.array(k))] for k in "ab")
        return Arx(a=a, b=b, delay=arx["delay"]).response(frequency, PERIOD)

    slopes = np.stack([(response(n, 1e-6) - response(n, -1e-6)) / 2e-6 for n in order], axis=1)
    chosen = [fit.names.index(n) for n in order]
    variance = np.einsum("fi,ij,fj->f", slopes, fit.covariance[np.ix_(chosen, chosen)], slopes.conj()).real
    return response(), np.sqrt(variance)
