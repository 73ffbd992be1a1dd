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

"""The joint fit in free run: hysteresis and dynamics together, of the order that the data support."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import Arx
from ...errors import DivergenceError, IdentificationError
from ...model.model import Model
from ...record import Notice, Record
from ..records.conditioning import records_to_fit
from ..records.intersample_error import intersample_error
from ..records.sampling import less
from ..steps.dynamics import Dynamics
from ..steps.hysteresis import hysteresis_numbers
from ..steps.linear_start import dynamics_behind, dynamics_of, follower, with_dynamics
from .fit import Fit, Progress, fit
from .normal_equations import Nuisance, residuals

SLOWEST_POLE = 0.1
"""Longest time constant of G, as a share of the longest record; slower poles describe drift."""
MUCH_CLOSER = 0.5
"""Ratio of costs below which a fit that has not converged is preferred to one of lower order that has."""
NEAR = 1e-7
"""Damping of a fit that starts from a linear one; more damping only slows down weak directions."""


def fit_lag(model: Model, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int]) -> Fit:
    """Joint fit of the hysteresis and of a lag: dead time with one pole, or dead time alone, whichever fits better.

    A pole is between 0 and 1: with a negative one the motion would lead, and ring for ever at the Nyquist frequency.

    Parameters
    ----------
    model : Model
        Model with fitted hysteresis; its dynamics are replaced.
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the records to fit.
    """
    kept, sizes = records_to_fit(records, floors, fitted)
    loop, gain = hysteresis_numbers(model), dynamics_of(model).dc_gain
    first, own_gain, delay = (f"{Arx.name}.{n}" for n in ("a[0]", "b[0]", "delay"))
    period = model.sample_period
    starts = [
        (Arx(a=(-pole,), b=(gain * (1.0 - pole),), delay=dead), period, [first, own_gain, delay])
        for pole in (0.2, 0.8)
        for dead in (1.0, 2.0)
    ]
    starts += [(Arx(a=(), b=(gain,), delay=lag), period, [delay]) for lag in (0.2, 1.0, 3.0)]
    fits = []
    for arx, at, free in starts:
        start = Model((model.hysteresis, arx), at, model.voltage_scale, model.displacement_scale)
        fits.append(fit(start, kept, [*loop, *free], floors=sizes, nuisance=Nuisance(offset=True)))
    simplest = min((f for f in fits if len(f.names) == len(loop) + 1), key=lambda f: f.cost)
    best = min((f for f in fits if not f.values.get(first, 0.0) > 0.0), key=lambda f: f.cost)
    return simplest if simplest.cost <= 1.01 * best.cost else best


def fit_joint(
    model: Model,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
    progress: Progress | None = None,
) -> Fit:
    """Joint fit of hysteresis and ARX at fixed delay and constant G(1), with a free offset in every record.

    Parameters
    ----------
    model : Model
        Model with start values.
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the records to fit.
    progress : callable, optional
        Called with a word and the fraction done.
    """
    kept, sizes = records_to_fit(records, floors, fitted)
    free = hysteresis_numbers(model)
    free += [f"{Arx.name}.{n}" for n in dynamics_of(model).free_names() if n != "delay"]
    return fit(model, kept, free, floors=sizes, nuisance=Nuisance(offset=True), damping=NEAR, progress=progress)


def without_intersample_error(
    model: Model, records: tuple[Record, ...], floors: Sequence[float], fitted: Collection[int]
) -> tuple[tuple[Record, ...], tuple[Notice, ...]]:
    """The records without the inter-sample error of averages; the same tuple if those that are fitted have none.

    The averages of a drive do not reach its turns, which loop and dynamics would describe by a later and wider loop.
    A notice names the records in which this is more than the floor.
    """
    try:
        lost = intersample_error(model, records)
    except DivergenceError:  # on a record that moves further than those that were fitted
        return records, ()
    if not any(lost[i].any() for i in fitted):
        return records, ()
    phases = dict.fromkeys(records[i].phase for i in fitted if np.std(lost[i]) > floors[i])
    message = f"{' and '.join(phases)} were stored as averages: the turns of the drive between samples were allowed for"
    return less(records, lost), (Notice("intersample_error", message),) if phases else ()


def fit_dynamics(
    model: Model,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
    broadband: Collection[int],
    delay: int,
    orders: tuple[int, int],
    progress: Progress | None = None,
) -> tuple[Fit, Dynamics, tuple[Notice, ...]]:
    """Start with an ARX model from w, then fit jointly; reduce the order until the data determine the result.

    Parameters
    ----------
    model : Model
        Model with fitted hysteresis.
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    fitted, broadband : collection of int
        Indices of the records of the joint fit, and of those for its start.
    delay : int
        Delay d [samples].
    orders : (int, int)
        Highest na and nb.
    progress : callable, optional
        Called with a word and the fraction done.

    Returns
    -------
    joint : Fit
        The first fit that the data determine, unless one of higher order is much closer; otherwise the closest one.
    dynamics : Dynamics
        ARX model from w at the start.
    notices : tuple of Notice
        ``order_reduced``, if the data do not support the requested orders.
    """
    slowest = SLOWEST_POLE * max(records[i].duration for i in fitted)
    tried: list[tuple[Fit, Dynamics]] = []
    for order in ladder(orders):
        start, dynamics = _start(model, records, floors, broadband, delay, order)
        joint = fit_joint(start, records, floors, fitted, progress)
        tried.append((joint, dynamics))
        if joint.converged and slowest_time(joint.model) < slowest:
            break
    else:
        joint, dynamics = min(tried, key=lambda outcome: outcome[0].cost)
    closer = [t for t in tried if slowest_time(t[0].model) < slowest and t[0].cost < MUCH_CLOSER * joint.cost]
    joint, dynamics = min(closer, key=lambda outcome: outcome[0].cost, default=(joint, dynamics))
    used = dynamics_of(joint.model)
    reached = used.array("a").size, used.array("b").size
    notices = dynamics.notices
    if reached != orders:
        message = (
            f"the data do not determine orders na = {orders[0]}, nb = {orders[1]}; {reached[0]}, "
            f"{reached[1]} were used instead"
        )
        notices += (Notice("order_reduced", message),)
    return joint, dynamics, notices


def ladder(orders: tuple[int, int]) -> list[tuple[int, int]]:
    """The orders to try, from the highest one to the lowest."""
    return [orders, *((n, n) for n in (6, 4, 3, 2, 1) if n < min(orders))]


def slowest_time(model: Model) -> float:
    """Longest time constant of the dynamics [s]."""
    return -model.sample_period / float(np.log(max(dynamics_of(model).pole_radius, 1e-300)))


def _start(
    model: Model,
    records: Sequence[Record],
    floors: Sequence[float],
    broadband: Collection[int],
    delay: int,
    orders: tuple[int, int],
) -> tuple[Model, Dynamics]:
    """Start of the joint fit (the better of the ARX model from w and one pole), and the ARX model."""
    dynamics = dynamics_behind(model, records, broadband, delay, orders)
    candidates = [model.with_effect(follower(model, delay, orders))]
    try:
        candidates.append(with_dynamics(model, dynamics.arx))
    except IdentificationError:
        return candidates[0], dynamics
    kept, sizes = records_to_fit(records, floors, broadband)

    def cost(candidate: Model) -> float:
        errors = residuals(candidate, kept, Nuisance(offset=True))
        return float(sum(np.mean(e**2) / f**2 for e, f in zip(errors, sizes, strict=True)))

    return min(candidates, key=cost), dynamics
