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

"""The next experiment: the phase that would separate two explanations that the data do not distinguish."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import DivergenceError
from ..identification.fit.fit import gauge
from ..identification.fit.normal_equations import grams
from ..identification.protocol import excitation
from ..identification.protocol.drive_limits import DriveLimits
from ..model.model import Model
from ..record import Record
from .search.candidates import free_numbers, weighted_sum
from .search.selection_result import Selection
from .search.training_data import TrainingData

Array = NDArray[np.float64]

SLOW = 1e-2
"""Sample period of the slow phases to choose from [s]."""


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """A phase to record, and the effects that it would separate.

    Parameters
    ----------
    phase : str
        Phase name.
    separates : tuple of str
        Effects that it would separate.
    """

    phase: str
    separates: tuple[str, ...]


def possible_phases(training_data: TrainingData, model: Model) -> dict[str, Record]:
    """Phases to choose from, inside the recorded drive range; their displacement is not measured yet and set to 0."""
    extent, period = training_data.extent, model.sample_period
    fast = DriveLimits(
        sample_period=period,
        voltage_min=extent.voltage_min,
        voltage_max=extent.voltage_max,
        safe_voltage=extent.voltage_min,
        max_slew_rate=np.inf,
        ramp_rate=extent.span,
    )
    slow = replace(fast, sample_period=max(period, SLOW))
    top = min(400.0, 0.02 / period)
    waves = {
        "staircase": (excitation.steps(slow, (0.0, 0.5, 1.0, 0.5, 0.0), 10.0, slew_rate=extent.span), slow),
        "triangle": (excitation.triangle(slow, (1.0, 0.75, 0.5, 0.25), 0.2), slow),
        "minor_loops": (excitation.ramps(slow, excitation.nested_loops(0.45, 5), extent.span), slow),
        "rest": (excitation.hold(slow, 0.0, 60.0), slow),
        "hold": (excitation.hold(slow, 0.8, 60.0), slow),
        "step": (excitation.steps(fast, (0.2, 0.8) * 4, 200 * period), fast),
        f"sine_{top:g}hz": (excitation.sine(fast, top, 10.0 / top), fast),
        "multisine": (
            excitation.multisine(fast, top / 20, min(5 * top, 0.2 / period), 0.3, 2, centre=0.5, seed=0),
            fast,
        ),
    }
    return {
        name: Record(wave, np.zeros(wave.size), limits.sample_period, phase=name)
        for name, (wave, limits) in waves.items()
    }


def separations(first: Model, second: Model, training_data: TrainingData) -> dict[str, float]:
    """Difference of two fitted models on every phase of `possible_phases`, after the first has adjusted its parameters.

    Parameters
    ----------
    first, second : Model
        Fitted models, one with each effect.
    training_data : TrainingData
        Recorded data, which constrain the common parameters.

    Returns
    -------
    dict of str to float
        Expected squared difference by phase name, in floors² per second of stage time.
    """
    drives = possible_phases(training_data, first)
    found = distances(first, second, training_data, drives)
    return {name: found[name] / record.duration for name, record in drives.items()}


def distances(
    first: Model, second: Model, training_data: TrainingData, drives: Mapping[str, Record]
) -> dict[str, float]:
    """Mean squared difference of two models on every drive, after the first has adjusted its parameters, in floors².

    It is 0 if one of the models diverges, because the drive is then far outside what the models describe.

    Parameters
    ----------
    first, second : Model
        Fitted models, one with each effect.
    training_data : TrainingData
        Recorded data, which constrain the common parameters.
    drives : mapping of str to Record
        Drives from rest; their displacement is not used.
    """
    free = free_numbers(first, training_data)
    directions = gauge(first, free)
    known = weighted_sum(grams(first, training_data.records, free, training_data.nuisance), training_data.floors)
    prior = directions.T @ known[:-1, :-1] @ directions
    floor = float(np.min(training_data.floors))
    found = {}
    for name, record in drives.items():
        try:
            (difference,) = (a - b for a, b in zip(second.simulate(record), first.simulate(record), strict=True))
        except DivergenceError:
            found[name] = 0.0
            continue
        (gram,) = grams(first, [record], free, training_data.nuisance, [difference[None, :]])
        total = gram.matrix[:-1, :-1] / (gram.size * floor * floor)
        q = len(free)
        cross = directions.T @ total[:q, q]
        inner = prior + directions.T @ total[:q, :q] @ directions
        scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
        solved = np.linalg.lstsq(inner * np.outer(scale, scale), scale * cross, rcond=1e-9)[0] * scale
        found[name] = max(0.0, float(total[q, q] - cross @ solved))
    return found


def best_next_experiment(selection: Selection, training_data: TrainingData) -> NextExperiment | None:
    """The phase of `possible_phases` that best separates an accepted effect from its rival; None if no effect has one.

    Parameters
    ----------
    selection : Selection
        Result of the search.
    training_data : TrainingData
        Recorded data.
    """
    for step in selection.accepted:
        mine = step.best
        others = [r for r in step.rivals if r.effect.public_name() != mine.effect.public_name()]
        if others:
            powers = separations(mine.fit.model, others[0].fit.model, training_data)
            pair = (mine.effect.public_name(), others[0].effect.public_name())
            return NextExperiment(max(powers, key=lambda name: powers[name]), pair)
    return None
