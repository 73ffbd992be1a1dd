"""Linear dynamics behind a known hysteresis: the start of the joint fit.

ARX from w, the output of the current Bouc-Wen operator, does not see the forgetting of the hysteresis state that
spoils ARX from v. Data without excitation show a lag only: a dead time and one pole, or a dead time alone.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ..effects import Arx
from ..errors import IdentificationError
from ..model import Model
from ..record import Record
from .carried import carried, select
from .dynamics import Dynamics, Signals, identify_arx
from .fit import Fit, fit
from .hysteresis import LOOP, hysteresis_name
from .normal_equations import Nuisance

ITERATIONS = 6
"""Steiglitz-McBride iterations of the start."""
LONGEST_DELAY = 12
"""Samples among which a delay is sought where no step shows it."""
FINER = 100
"""Sample periods of a pure lag per sample of the record."""


def hysteresis_signals(model: Model, records: Sequence[Record], wanted: Collection[int]) -> Signals:
    """(w, y) of the records `wanted`: hysteresis output of the model, and normalised displacement."""
    alone = Model((model[hysteresis_name(model)],), model.sample_period, model.voltage_scale)
    kept = carried(records, wanted)
    outputs = dict(zip(kept, alone.simulate([records[i] for i in kept]), strict=True))
    return [(outputs[i], np.array(records[i].displacement / model.displacement_scale)) for i in sorted(wanted)]


def dynamics_behind(
    model: Model, records: Sequence[Record], broadband: Collection[int], delay: int, orders: tuple[int, int]
) -> Dynamics:
    """ARX from w of the model's hysteresis, its dc gain set to that of the model's `Arx`.

    Parameters
    ----------
    model : Model
        With a hysteresis that has been fitted.
    records : sequence of Record
        The experiment, in order.
    broadband : collection of int
        Indices of the records to use, all at the model's sample period.
    delay : int
        d, samples.
    orders : (int, int)
        na and nb.
    """
    return identify_arx(hysteresis_signals(model, records, broadband), delay, model.sample_period, orders, ITERATIONS)


def with_dynamics(model: Model, arx: Arx) -> Model:
    """The model with other dynamics, scaled so that its dc gain, the gauge, stays.

    Raises
    ------
    IdentificationError
        If the dc gain of `arx` has the other sign or is zero.
    """
    before = model["arx"]
    assert isinstance(before, Arx)
    ratio = arx.dc_gain / before.dc_gain
    if not ratio > 0.0:
        raise IdentificationError(
            f"dynamics: got a dc gain of {arx.dc_gain:.3g}, expected the sign of {before.dc_gain:.3g}; "
            "use excitation that reaches low frequencies"
        )
    return model.with_effect(arx.with_values(b=tuple((arx.array("b") / ratio).tolist())))


def delay_by_cost(signals: Signals, sample_period: float, orders: tuple[int, int], slack: float = 0.005) -> int:
    """Longest delay that costs nothing: the one-step error stays within `slack` of the best.

    For data without steps. A fit cannot tell d from d − 1 with b1 = 0, so the largest is taken.
    """
    errors = [identify_arx(signals, d, sample_period, orders).one_step_error for d in range(1, LONGEST_DELAY + 1)]
    best = min(errors)
    return max(d for d, e in enumerate(errors, start=1) if e <= best * (1.0 + slack))


def fit_lag(model: Model, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int]) -> Fit:
    """Joint fit of the hysteresis and of a lag: dead time with one pole, or dead time alone, whichever fits better.

    Parameters
    ----------
    model : Model
        With a hysteresis that has been fitted; its dynamics are replaced.
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the records to fit.
    """
    kept, sizes = select(records, floors, fitted)
    before, name = model["arx"], hysteresis_name(model)
    assert isinstance(before, Arx)
    gain = before.dc_gain
    loop = [f"{name}.{n}" for n in LOOP]
    period = model.sample_period
    starts = [
        (Arx(a=(-pole,), b=(gain * (1.0 - pole),), delay=dead), period, ["arx.a[0]", "arx.b[0]", "arx.delay"])
        for pole in (0.2, 0.8)
        for dead in (1.0, 2.0)
    ]
    starts += [(Arx(a=(), b=(gain,), delay=lag * FINER), period / FINER, ["arx.delay"]) for lag in (0.2, 1.0, 3.0)]
    fits = []
    for arx, at, free in starts:
        start = Model((model[name], arx), at, model.voltage_scale, model.displacement_scale)
        fits.append(fit(start, kept, [*loop, *free], floors=sizes, nuisance=Nuisance(offset=True)))
    simplest = min((f for f in fits if len(f.names) == len(loop) + 1), key=lambda f: f.cost)
    best = min(fits, key=lambda f: f.cost)
    return simplest if simplest.cost <= 1.01 * best.cost else best
