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

"""`hidden_effect`: a simulated stage with an effect that its user does not know, chosen by a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError
from .plant import PlantParameters

Changes = dict[str, Any]
Draw = Callable[[np.random.Generator, PlantParameters, float], Changes]


@dataclass(frozen=True)
class HiddenEffect:
    """The hidden effect, and the stage that contains it.

    Parameters
    ----------
    name : str
        Identifier of the effect in the catalogue.
    changes : dict
        Quantities of the plant that were changed, by dotted name.
    parameters : PlantParameters
        The changed stage.
    """

    name: str
    changes: Changes
    parameters: PlantParameters


def hidden_effect(
    seed: int, base: PlantParameters | None = None, *, name: str | None = None, highest_voltage: float | None = None
) -> HiddenEffect:
    """Draw one effect of the catalogue and its size. The size is realistic, and large enough to be found.

    Parameters
    ----------
    seed : int
        Seed of the random choice; the same seed hides the same effect.
    base : PlantParameters, optional
        Stage that gets the effect, in addition to hidden effects that it already has. Default: a stage without any.
    name : str, optional
        Draw only the size of this effect.
    highest_voltage : float, optional
        Highest drive of the experiment [V]; saturation is drawn near it. Default: the highest that the stage accepts.

    Returns
    -------
    HiddenEffect

    Raises
    ------
    ParameterError
        If the name is unknown, or the effect does not fit the base.
    """
    base = PlantParameters() if base is None else base
    rng = np.random.default_rng(seed)
    drawn = str(rng.choice(HIDDEN_EFFECTS))
    chosen = drawn if name is None else name
    if chosen not in _DRAWS:
        raise ParameterError(f"hidden effect: got {chosen!r}, expected one of {', '.join(HIDDEN_EFFECTS)}")
    highest = base.electronics.voltage_max if highest_voltage is None else highest_voltage
    changes = _DRAWS[chosen](rng, base, highest)
    return HiddenEffect(chosen, changes, base.with_values(changes))


def _size(rng: np.random.Generator, low: float, high: float) -> float:
    """A size between `low` and `high`, uniform in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice([-1.0, 1.0])) * _size(rng, low, high)


def _creep(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    if rng.random() < 0.3:
        times = sorted(_size(rng, 0.05, 20.0) for _ in range(2))
        return {"creep.times": times, "creep.weights": [_size(rng, 0.005, 0.03) for _ in times]}
    return {"creep.gamma": _size(rng, 0.006, 0.02), "creep.slope": float(rng.choice([0.0, 0.08]))}


def _memory(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    radii = np.geomspace(_size(rng, 0.008, 0.015), _size(rng, 0.15, 0.3), int(rng.integers(5, 9)))
    weights = _size(rng, 0.05, 0.2) * radii / radii.sum()
    return {
        "hysteresis.play_radii": [*base.hysteresis.play_radii, *radii.tolist()],
        "hysteresis.play_weights": [*base.hysteresis.play_weights, *weights.tolist()],
    }


def _asymmetry(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    room = base.hysteresis.beta - abs(base.hysteresis.gamma)
    share = float(rng.uniform(0.0, 1.0))
    total = min(0.4 * base.hysteresis.beta, room) * float(rng.uniform(0.4, 0.9))
    signs = rng.choice([-1.0, 1.0], 2)
    phi1, phi2 = signs * total * np.array([share, 1.0 - share])
    return {"hysteresis.phi1": float(phi1), "hysteresis.phi2": float(phi2)}


def _thermal_drift(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    relative = _signed(rng, 0.004, 0.03)
    return {
        "environment.temperature_time": _size(rng, 40.0, 300.0),
        "environment.thermal_expansion": relative * base.full_stroke / base.environment.temperature_rise,
    }


def _gain_drift(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    return {
        "environment.temperature_time": _size(rng, 40.0, 300.0),
        "environment.gain_per_kelvin": _signed(rng, 0.004, 0.02) / base.environment.temperature_rise,
    }


def _saturation(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    rail = base.electronics.amplifier_gain * highest
    return {
        "electronics.amplifier_max": rail * float(rng.uniform(0.85, 0.97)),
        "electronics.saturation_corner": rail * _size(rng, 0.005, 0.03),
    }


def _slew(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    # the steepest slope of a sine of 150 to 350 Hz, whose peak-to-peak value is 5/6 of the range at the piezo
    slope = np.pi * base.electronics.amplifier_gain * highest * 5 / 6
    return {"electronics.amplifier_slew": float(slope * rng.uniform(150.0, 350.0))}


def _resonance(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    return {
        "structure.resonance_share": _size(rng, 0.02, 0.08),
        "structure.resonance_frequency": _size(rng, 500.0, 3000.0),
        "structure.resonance_damping": _size(rng, 0.005, 0.03),
    }


def _hum(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    return {
        "environment.hum": base.full_stroke * _size(rng, 1e-3, 5e-3),
        "environment.hum_frequency": float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05)),
    }


def _coupling(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    return {
        "environment.coupling": _signed(rng, 0.005, 0.012),
        "environment.other_amplitude": 0.5 * base.full_stroke,
        "environment.other_frequency": _size(rng, 1.0, 20.0),
    }


def _sensor(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
    return {"sensor.quadratic": _signed(rng, 0.002, 0.01), "sensor.cubic": _signed(rng, 0.002, 0.01)}


def _one(name: str, low: float, high: float, signed: bool = False) -> Draw:
    def draw(rng: np.random.Generator, base: PlantParameters, highest: float) -> Changes:
        return {name: (_signed if signed else _size)(rng, low, high)}

    return draw


_DRAWS: dict[str, Draw] = {
    "creep": _creep,
    "thermal_drift": _thermal_drift,
    "gain_drift": _gain_drift,
    "even_input_polynomial": _one("hysteresis.even2", 0.02, 0.1, signed=True),
    "asymmetric_hysteresis": _asymmetry,
    "hysteresis_exponent": _one("hysteresis.exponent", 1.2, 1.9),
    "hysteresis_memory": _memory,
    "rate_dependent_hysteresis": _one("hysteresis.rate_gain", 0.01, 0.04),
    "initial_state": _one("hysteresis.initial_state", 0.03, 0.15, signed=True),
    "backlash": _one("hysteresis.backlash", 0.01, 0.06),
    "softening": _one("structure.softening_cubic", 0.01, 0.05, signed=True),
    "extra_delay": _one("electronics.extra_delay", 5e-6, 15e-6),
    "amplifier_bandwidth": _one("electronics.amplifier_bandwidth", 2.5e3, 6e3),
    "sensor_bandwidth": _one("sensor.bandwidth", 500.0, 5e3),
    "amplifier_slew_limit": _slew,
    "amplifier_saturation": _saturation,
    "extra_resonance": _resonance,
    "sensor_nonlinearity": _sensor,
    "mains_hum": _hum,
    "axis_coupling": _coupling,
}
"""How every effect is drawn at random."""

HIDDEN_EFFECTS: tuple[str, ...] = tuple(_DRAWS)
"""Effects that `hidden_effect` draws from, by their identifiers in the catalogue."""
