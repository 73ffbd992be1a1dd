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

"""Starts for a joint fit of the published model, with dynamics of the order that its authors use.

Missing effects can only be judged from a baseline that describes the data as well as the published model can. With
dynamics of too low an order, any linear effect would improve it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from ..effects import HYSTERESIS, Arx, Offset
from ..errors import IdentificationError
from ..model.model import Model
from ..record import CONDITIONING, Experiment, Record
from .fit.gauge import Gauge
from .identify import identify
from .records.roles import Roles, roles_of
from .steps.delay import identify_delay
from .steps.dynamics import delay_of
from .steps.hysteresis import fit_hysteresis
from .steps.linear_start import (
    FEW_ITERATIONS,
    ITERATIONS,
    dynamics_behind,
    follower,
    form_of,
    hysteresis_signals,
    with_dynamics,
)
from .steps.modes import identify_modes

ORDERS = (8, 8)
"""na and nb, as in the paper; coefficients that the data do not need stay at zero in the joint fit."""


def start_models(records: Sequence[Record], fitted: Collection[int]) -> Iterator[Model]:
    """Starts for a joint fit: hysteresis from slow loops, delay from steps, dynamics from broadband records.

    Only the records with the indices `fitted` are used. A missing effect can disturb the iterations of the dynamics, so
    a model after few iterations follows the one after many. Noise may hide modes that larger motion shows, so the next
    model uses all records that move. The last one has the loop of the paper: without slow records, the loop that was
    fitted can end as a relay, and no joint fit leads back.
    """
    experiment = Experiment(tuple(records))
    roles = roles_of(experiment)
    loops = [i for i in roles.loops if i in fitted]
    at_full_rate, broadband, moving = _telling_dynamics(experiment, roles, fitted)
    if not loops or not broadband:
        known = Experiment(experiment.records[: max(fitted) + 1])
        aside = {i for i in range(len(known.records)) if i not in fitted}
        yield identify(as_conditioning(known, aside), held_out=()).model
        return
    fast = [records[i] for i in at_full_rate]
    try:
        delay = max(1, identify_delay([r for r in fast if r.phase.startswith("step")] or fast).samples)
    except IdentificationError:
        delay = None
    gauge = Gauge.natural(records, loops)
    loop = (HYSTERESIS(), Arx(a=(), b=(gauge.gain,), delay=delay or 1))
    frame = Model(loop, experiment.fastest_period, gauge.voltage_scale, gauge.displacement_scale)
    start = fit_hysteresis(frame, records, loops).model
    delay = delay or _delay_without_steps(start, records, broadband)
    for iterations in (ITERATIONS, FEW_ITERATIONS):
        yield _with_dynamics(start, records, (broadband, moving), delay, iterations)
    if moving != broadband:
        yield _with_dynamics(start, records, (moving, broadband), delay, ITERATIONS)
    yield _with_dynamics(frame, records, (broadband, moving), delay, ITERATIONS)


def modal_models(model: Model, records: Sequence[Record], fitted: Collection[int]) -> Iterator[Model]:
    """The model with sums of modes as dynamics: from the broadband records of `fitted`, and from all that move.

    Its hysteresis was fitted before. ARX iterations do not find modes far below the sampling rate. A given model
    without dynamics keeps none.
    """
    experiment = Experiment(tuple(records))
    _, broadband, moving = _telling_dynamics(experiment, roles_of(experiment), fitted)
    if not broadband or Arx.name not in model:
        return
    for chosen in (broadband, moving) if moving != broadband else (broadband,):
        with suppress(IdentificationError):
            signals = hysteresis_signals(model, records, chosen)
            yield with_dynamics(model, identify_modes(signals, *form_of(model), ITERATIONS).arx)


def as_conditioning(experiment: Experiment, aside: Collection[int]) -> Experiment:
    """The experiment in which the records `aside` only determine the state of the stage."""
    records = tuple(replace(r, phase=CONDITIONING) if i in aside else r for i, r in enumerate(experiment.records))
    return Experiment(records, experiment.source)


def _telling_dynamics(
    experiment: Experiment, roles: Roles, fitted: Collection[int]
) -> tuple[list[int], list[int], list[int]]:
    """Records at the full rate, broadband ones, and moving ones at it; sines alone do not determine the dynamics."""
    broadband = [i for i in roles.broadband if i in fitted]
    at_full_rate = [i for i in fitted if experiment[i].sample_period < 1.001 * experiment.fastest_period]
    return at_full_rate, broadband, [i for i in at_full_rate if broadband and not roles.contents[i].is_slow]


def _with_dynamics(
    start: Model, records: Sequence[Record], choices: Sequence[Collection[int]], delay: int, iterations: int
) -> Model:
    for chosen in choices:
        with suppress(IdentificationError):  # noise may not determine the dc gain
            return with_dynamics(start, dynamics_behind(start, records, chosen, delay, ORDERS, iterations).arx)
    return start.with_effect(follower(start, delay, ORDERS))


def _delay_without_steps(model: Model, records: Sequence[Record], broadband: Collection[int]) -> int:
    """Delay from the noise records, or 0 if this predicts better, because hum can hide the first response."""
    found = delay_of(hysteresis_signals(model, records, broadband))
    errors = {}
    for delay in (found, 1):
        with suppress(IdentificationError):  # unstable dynamics do not determine the delay
            errors[delay] = dynamics_behind(model, records, broadband, delay, ORDERS).free_run_error
    return min(errors, key=errors.__getitem__, default=found)


def exact(model: Model) -> Model:
    """The model with the exact loop, which accepts the terms of the catalogue, and with a sensor zero.

    Raises
    ------
    ModelError
        If a published loop has another exponent than n = 1, for which there is no exact step.
    """
    return with_zero(model.with_hysteresis(model.hysteresis.exact()) if model.has_hysteresis else model)


def with_zero(model: Model) -> Model:
    """The model with a sensor zero."""
    return model if Offset.name in model else model.with_effect(Offset())
