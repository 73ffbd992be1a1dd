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

"""Linear dynamics after a known hysteresis: the start of the joint fit.

An ARX model from w, the output of the present hysteresis operator, is not biased by the loss of memory of the
hysteresis state, as an ARX model from v is.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...blocks.block import Array
from ...effects import Arx, ChainPosition
from ...errors import IdentificationError
from ...model.model import Model
from ...record import Record
from ..records.conditioning import with_conditioning
from .dynamics import Dynamics, identify_arx
from .regressors import Signals

ITERATIONS = 12
"""Largest number of Steiglitz-McBride iterations; weak, lightly damped modes converge last."""
FEW_ITERATIONS = 3
"""Smaller number that is tried too, because a missing effect can disturb many iterations."""


def hysteresis_signals(model: Model, records: Sequence[Record], wanted: Collection[int]) -> Signals:
    """(w, y) of the records `wanted`: hysteresis output of the model, and normalised displacement."""
    before = tuple(e for e in model.effects if e.place < ChainPosition.DYNAMICS)
    alone = Model(before, model.sample_period, model.voltage_scale)
    kept = with_conditioning(records, wanted)
    outputs = dict(zip(kept, alone.free_run([records[i] for i in kept]), strict=True))
    return [(outputs[i], np.array(records[i].displacement / model.displacement_scale)) for i in sorted(wanted)]


def dynamics_signals(
    model: Model, records: Sequence[Record], wanted: Collection[int], left: Sequence[Array]
) -> Signals:
    """(w, x) of the records `wanted`: hysteresis output of the model, and what dynamics behind it have to give.

    That is what its present dynamics give, and what the whole model leaves [m]. So x is free of all that the model has
    behind the dynamics, e.g. hum.
    """
    through = tuple(e for e in model.effects if e.place < ChainPosition.DYNAMICS or isinstance(e, Arx))
    kept = with_conditioning(records, wanted)
    moved = Model(through, model.sample_period, model.voltage_scale).free_run([records[i] for i in kept])
    given = dict(zip(kept, moved, strict=True))
    inputs = hysteresis_signals(model, records, wanted)
    return [
        (w, given[i] + left[i] / model.displacement_scale) for i, (w, _) in zip(sorted(wanted), inputs, strict=True)
    ]


def dynamics_behind(
    model: Model,
    records: Sequence[Record],
    broadband: Collection[int],
    delay: int,
    orders: tuple[int, int],
    iterations: int = ITERATIONS,
) -> Dynamics:
    """ARX model from w of the model's hysteresis, with the dc gain of the model's `Arx`.

    Parameters
    ----------
    model : Model
        Model with fitted hysteresis.
    records : sequence of Record
        The experiment, in order.
    broadband : collection of int
        Indices of the records to use, all at the model's sample period.
    delay : int
        d, samples.
    orders : (int, int)
        na and nb.
    iterations : int
        Largest number of Steiglitz-McBride iterations.
    """
    return identify_arx(hysteresis_signals(model, records, broadband), delay, model.sample_period, orders, iterations)


def with_dynamics(model: Model, arx: Arx) -> Model:
    """The model with other dynamics, scaled to the same dc gain.

    Raises
    ------
    IdentificationError
        If the dc gain of `arx` has the other sign or is zero.
    """
    ratio = arx.dc_gain / dynamics_of(model).dc_gain
    if not ratio > 0.0:
        raise IdentificationError(
            f"dynamics: got a dc gain of {arx.dc_gain:.3g}, expected the sign of {dynamics_of(model).dc_gain:.3g}; "
            "use excitation that reaches low frequencies"
        )
    return model.with_effect(arx.with_values(b=tuple((arx.array("b") / ratio).tolist())))


def dynamics_of(model: Model) -> Arx:
    """The linear dynamics in a model."""
    return model.effect(Arx)


def form_of(model: Model) -> tuple[int, float, tuple[int, int]]:
    """Delay in samples, sample period [s] and orders of the dynamics in a model."""
    arx = dynamics_of(model)
    return round(arx["delay"]), model.sample_period, (arx.array("a").size, arx.array("b").size)


def follower(model: Model, delay: int, orders: tuple[int, int], pole: float = 0.5) -> Arx:
    """One pole with the dc gain of the model, written with higher orders, as a safe start."""
    na, nb = orders
    pole = pole if na else 0.0
    gain = dynamics_of(model).dc_gain * (1.0 - pole)
    return Arx(a=(-pole, *(0.0,) * (na - 1)) if na else (), b=(gain, *(0.0,) * (nb - 1)), delay=delay)
