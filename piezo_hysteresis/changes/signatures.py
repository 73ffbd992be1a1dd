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

"""Influence of each possible change of a given model on its prediction.

A delay and a filter act on the predicted displacement as a whole; every other change is linear where it is small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..effects import (
    AmplifierBandwidthHeld,
    Arx,
    Creep,
    CreepFractional,
    CreepTwoRates,
    Effect,
    ExtraDelay,
    ExtraResonance,
    Offset,
    SecondOrderLowPass,
    SensorBandwidth,
    Softening,
)
from ..errors import DivergenceError
from ..identification.steps.remaining_lag import amplifier_of
from ..model.chain import RUNAWAY
from ..model.model import Model
from ..online.change.score import loop_heights
from ..record import Record
from .change_kinds import KINDS
from .lag.filtered_signal import derivatives, filtered, shifted

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Dead time [samples] below which there is none."""
DRIFT_TIME = 3.0
"""Time constant of a drift over the length of the longest record: the drift within a record is almost linear."""


@dataclass(frozen=True, eq=False, slots=True)
class ChangeablePrediction:
    """Prediction of one record by a model, and its derivatives.

    Parameters
    ----------
    record : Record
        The measured record.
    y : (n,) ndarray
        Predicted displacement without the zero of the sensor [m].
    before : float
        Predicted displacement before the first sample [m].
    rows : mapping of str to (n,) ndarray
        Change of y per unit of every linear change [m].
    known : mapping of int to (4, n) ndarray
        What `between` has computed, by the identity of the signal.
    """

    record: Record
    y: Array
    before: float
    rows: dict[str, Array]
    known: dict[int, Array] = field(default_factory=dict)

    def between(self, signal: Array, before: float) -> Array:
        """Derivatives of y or of a row between samples (4, n); the signal was `before` until the first sample."""
        if id(signal) not in self.known:
            self.known[id(signal)] = derivatives(signal, before)
        return self.known[id(signal)]


def creep_numbers(model: Model) -> dict[str, float]:
    """Parameters that together determine the rate of creep, with their values."""
    values = model.values()
    names = [f"{e.name}.gamma" for e in (Creep, CreepFractional)]
    names += [f"{CreepTwoRates.name}.{n}" for n in ("gamma_fast", "gamma_slow")]
    return {n: values[n] for n in names if values.get(n)}


def predictions(model: Model, records: Sequence[Record]) -> tuple[list[ChangeablePrediction], float]:
    """Free run of every record with its derivatives by the linear changes; share of the loop in the displacement.

    A change of the loop height does not change the gain, because that share of the displacement is subtracted.
    The changes are ``gain``, ``loop`` and ``creep``, relative; ``resonance`` in Hz; ``low_pass_before`` in s;
    ``softening`` per cube of the range; ``drift`` in m at the end of the longest record.

    Raises
    ------
    DivergenceError
        If the model diverges.
    """
    bare = model.without(Offset.name) if Offset.name in model else model
    loop, creep = loop_heights(bare), creep_numbers(bare)
    resonance = [f"{ExtraResonance.name}.f0"] if ExtraResonance.name in bare else []
    before_loop = _slopes_of_amplifier(bare)
    wanted = [*loop, *creep, *resonance, *before_loop]
    span = max(float(np.ptp(r.displacement)) for r in records)
    longest = max(r.duration for r in records)
    parts: dict[int, tuple[list[Array], list[Array]]] = {}
    order: list[str] = []
    for index, part, y, names, slopes in bare.linearise(records, wanted):
        bound = RUNAWAY * bare.displacement_scale
        if not (np.abs(y).max() < bound and np.abs(slopes).max(initial=0.0) < RUNAWAY * bound):
            raise DivergenceError(bare.effects[-1].name, part.start, part.start * records[index].sample_period)
        order = list(names)
        outputs, rows = parts.setdefault(index, ([], []))
        outputs.append(y.copy())
        rows.append(slopes.copy())
    found: list[ChangeablePrediction] = []
    before = 0.0
    for index, record in enumerate(records):
        y = np.concatenate(parts[index][0])
        slopes = np.concatenate(parts[index][1], axis=1)
        if not record.continues:
            before = settled(bare, record.settled_voltage)
        by: dict[str, Array] = {"gain": y}
        for name, numbers in (("loop", loop), (Creep.name, creep)):
            if numbers:
                by[name] = sum((numbers[n] * slopes[order.index(n)] for n in numbers), np.zeros(y.size))
        if resonance:
            by["resonance"] = slopes[order.index(resonance[0])]
        if before_loop:
            by["low_pass_before"] = sum((s * slopes[order.index(n)] for n, s in before_loop.items()), np.zeros(y.size))
        by[Softening.name] = -((y / span) ** 3) * span
        time = record.start_time + record.sample_period * np.arange(y.size)
        by["drift"] = np.expm1(-time / (DRIFT_TIME * longest)) / np.expm1(-1.0 / DRIFT_TIME)
        found.append(ChangeablePrediction(record, y, before, by))
        before = float(y[-1])
    return found, _loop_apart(found)


def _slopes_of_amplifier(model: Model) -> dict[str, float]:
    """Changes of the parameters if an amplifier is slower by 1 s, as in `shaped_model`; none without an amplifier."""
    amplifier = amplifier_of(model)
    if amplifier is None:
        return {}
    found = {f"{amplifier.name}.tau": 1.0}
    if Arx.name in model:
        _, slope = amplifier.lag(model.sample_period)
        found[f"{Arx.name}.delay"] = (1.0 - slope) / model.sample_period
    return found


def _loop_apart(found: Sequence[ChangeablePrediction]) -> float:
    """Subtract the influence of a gain from the derivatives by the loop height, and return its share."""
    if "loop" not in found[0].rows:
        return 0.0
    moving = np.concatenate([p.y - p.y.mean() for p in found])
    loops = np.concatenate([p.rows["loop"] - p.rows["loop"].mean() for p in found])
    share = float(moving @ loops / (moving @ moving))
    for p in found:
        p.rows["loop"] = p.rows["loop"] - share * p.y
    return share


def settled(model: Model, voltage: float) -> float:
    """Displacement of a stage that has been at `voltage` for a long time [m]."""
    chain, x = model.at(model.sample_period), voltage
    for block in chain.blocks:
        x = block.static(x)
    return float(x)


def delayed(prediction: ChangeablePrediction, signal: Array, before: float, tau: float) -> Array:
    """A signal of the record, delayed by `tau` [s], which may be negative. It was `before` until the first sample."""
    return shifted(prediction.between(signal, before), tau / prediction.record.sample_period)


def filtered_by(
    prediction: ChangeablePrediction, signal: Array, before: float, tau: float, zeta: float | None = None
) -> Array:
    """A signal of the record behind a filter with time constant `tau` [s], of second order with a damping ratio."""
    if tau <= 0.0:
        return signal
    return filtered(prediction.between(signal, before), before, prediction.record.sample_period, tau, zeta)


Shaped = Callable[[ChangeablePrediction, Array, float, float], Array]
"""(prediction, signal, value before, size) → the changed signal."""

SECOND_ORDER = {key: kind.damping for key, kind in KINDS.items() if kind.damping}
"""Damping ratio of every filter of second order, by the key of the change."""

SHAPES: dict[str, Shaped] = {
    "delay": delayed,
    "low_pass": filtered_by,
    **{key: partial(filtered_by, zeta=zeta) for key, zeta in SECOND_ORDER.items()},
}
"""Changes that act on the whole prediction, by name."""


def shaped_model(model: Model, key: str, size: float) -> Model:
    """The model with a lag: later by `size` [s], or with a low-pass of that time constant [s].

    Raises
    ------
    ParameterError
        If a parameter leaves its bounds, e.g. if it would be earlier by more than `delay_of`.
    """
    if key == "low_pass_before":
        old = amplifier_of(model) or AmplifierBandwidthHeld()
        new = old.with_values(tau=old["tau"] + size)
        # the hold of the converter stays a delay of the stage
        held = size - (new.lag(model.sample_period)[0] - old.lag(model.sample_period)[0])
        return shaped_model(model.with_effect(new), "delay", max(held, -delay_of(model)))
    if KINDS[key].is_filter:
        return with_low_pass(model, size, SECOND_ORDER.get(key))
    later = size
    if ExtraDelay.name in model or Arx.name not in model:
        tau = size + (model[ExtraDelay.name]["tau"] if ExtraDelay.name in model else 0.0)
        later = min(tau, 0.0) if Arx.name in model else 0.0
        model = model.with_effect(ExtraDelay(tau=tau - later))
    if later:
        delay = model[Arx.name]["delay"] + later / model.sample_period
        model = model.with_values({f"{Arx.name}.delay": 0.0 if abs(delay) < ROUNDING else delay})
    return model


def delay_of(model: Model) -> float:
    """Dead time of a model [s]: no stage that the model describes can respond earlier by more than this."""
    dynamics = model[Arx.name]["delay"] * model.sample_period if Arx.name in model else 0.0
    return float(dynamics + (model[ExtraDelay.name]["tau"] if ExtraDelay.name in model else 0.0))


def with_low_pass(model: Model, tau: float, zeta: float | None = None) -> Model:
    """The model with a low-pass of the sensor with time constant `tau` [s], of second order with a damping ratio.

    One that the model has keeps its poles and its damping ratio, and is slower by the lag of the new one.
    """
    new: Effect = SensorBandwidth(tau=tau) if zeta is None else SecondOrderLowPass(tau=tau, zeta=zeta)
    if new.name in model and not model[new.name].is_off:
        old, form = model[new.name], "poles" if zeta is None else "zeta"
        new = old.with_values(tau=old["tau"] + tau * new[form] / old[form])
    return model.with_effect(new)
