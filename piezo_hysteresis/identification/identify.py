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

"""`identify`: identifies a model from the phases that an experiment contains.

The three published steps give the start values. Then all parameters, including the dynamics, are fitted jointly in
free run. G(1) is held, because only the product of the gains of hysteresis and dynamics is determined.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..effects import HYSTERESIS, Arx, HysteresisOperator, Offset
from ..errors import IdentificationError, counted
from ..model.model import Model
from ..model.provenance import provenance, record_errors
from ..model.sample_periods import identified_periods
from ..record import Experiment, Notice, Record
from .fit.fit import Fit, Progress
from .fit.form_uncertainty import ADEQUACY
from .fit.gauge import Gauge
from .fit.normal_equations import residuals
from .identification import INSEPARABLE, Identification, PhaseError, correlated_pairs, phase_errors, undetermined
from .identified_range import LAG_ERROR, identified_range
from .inputs import check_gauge, experiment_of
from .joint_fits import (
    AT_THE_FLOOR,
    FitInput,
    FitOutcome,
    fit_broadband,
    fit_loops,
    fit_structured,
    fit_structured_broadband,
)
from .one_core import on_one_core
from .published_steps import delay_of_steps, published_steps
from .records.conditioning_split import known_from_within
from .records.excitation_check import STILL, one_way
from .records.noise import without_voltage_noise
from .records.one_axis import one_axis
from .records.roles import HELD_OUT, Roles, roles_of
from .steps.remaining_lag import lag
from .steps.three_steps import behind_the_gauge
from .structure.state_at_rest import begun_as_conditioned, rest_notices

FEWEST_SAMPLES = 32
"""Number of samples of the shortest record that can show a loop."""


@on_one_core
def identify(
    experiment: Record | Iterable[Record],
    *,
    voltage_scale: float | None = None,
    displacement_scale: float | None = None,
    gain: float | None = None,
    orders: tuple[int, int] | None = (8, 8),
    hysteresis: type[HysteresisOperator] = HYSTERESIS,
    memory: bool = False,
    held_out: Collection[str] = HELD_OUT,
    progress: Progress | None = None,
) -> Identification:
    """Identify delay, linear dynamics and modified Bouc-Wen hysteresis from any mix of records.

    Parameters
    ----------
    experiment : Experiment, Record, or iterable of Record
        Records of any kind and sample period; a record that continues starts with the state of the one before.
    voltage_scale : float, optional
        v = u / voltage_scale [V]; default the largest absolute voltage.
    displacement_scale : float, optional
        Displacement at normalised output 1 [m]; default the range of the displacement.
    gain : float, optional
        G(1): the settled output is w times this gain. Default 1, or -1 if the stage moves against the drive.
    orders : (int, int) or None
        na and nb of the ARX model; None chooses the lowest order that is as good as any other.
    hysteresis : type of HysteresisOperator
        Hysteresis operator; `PublishedBoucWen` for data that were computed by Eq. (7).
    memory : bool
        Choose the structure by cross-validation: plays or the state of the operator, creep, square, level dependence,
        and without broadband records a mode. Beside broadband records, the dynamics are ARX.
    held_out : collection of str
        Names of phases that are not fitted; the model is tested on them.
    progress : callable, optional
        Called with the name of the step and the fraction done.

    Returns
    -------
    Identification
        Model, uncertainties, errors per phase and notices.

    Raises
    ------
    IdentificationError
        If the drive does not move in any record, or a fit cannot be started.
    RecordError
        If `experiment` holds no records or one of several drives, or `held_out` names a phase that it does not have.
    ParameterError
        If a scale is not positive, or `gain` is 0, or has the wrong sign for plays.

    Notes
    -----
    Every record has the same weight in the joint fit. Its residual is divided by its noise floor: the sensor noise, but
    at least 0.03 % of the range. The intervals contain the uncertainty of the model's form
    (`with_form_uncertainty`).
    """
    report = progress or (lambda word, fraction: None)
    check_gauge(voltage_scale, displacement_scale, gain, hysteresis)
    given = experiment_of(experiment)
    axes_notices = one_axis(given)
    recorded, conditioning_notices = known_from_within(given)
    roles = roles_of(recorded, held_out)
    experiment, noise_notices = without_voltage_noise(recorded)
    records = experiment.records
    reach = _range_of_motion(records, roles)
    natural = Gauge.natural(records, roles.loops)
    chosen_gauge = {"voltage_scale": voltage_scale, "displacement_scale": displacement_scale, "gain": gain}
    gauge = replace(natural, **{name: value for name, value in chosen_gauge.items() if value is not None})
    scale_v, scale_y = gauge.voltage_scale, gauge.displacement_scale
    floors = [max(c.noise, ADEQUACY * reach) for c in roles.contents]
    period = experiment.fastest_period
    notices: list[Notice] = [*experiment.notices, *axes_notices, *conditioning_notices, *noise_notices]

    report("step 1: delay", 0.0)
    delay = delay_of_steps(experiment, roles, notices)
    published = published_steps(experiment, scale_v, scale_y, orders or (8, 8), hysteresis, delay, notices)

    report("step 3: hysteresis", 0.1)
    dead = 1.0 if delay is None else max(1.0, delay.time / period)
    frame = Model((hysteresis(), Arx(a=(), b=(gauge.gain,), delay=dead)), period, scale_v, scale_y)
    start = behind_the_gauge(frame, published, records, roles.loops)
    inputs = FitInput(start, records, floors, roles, reach, natural, gauge, report)
    structured = memory and start.hysteresis.memoryless() is not None
    if roles.broadband:
        samples = None if delay is None else round(dead)
        found = fit_broadband(inputs, samples, orders)
        if undetermined(found.fit) or correlated_pairs(found.fit, INSEPARABLE):
            # from a loop without loss, to which ringing can lead, no joint fit leads back
            other = fit_broadband(replace(inputs, start=frame), samples, orders)
            found = min(found, other, key=lambda outcome: outcome.fit.cost)
        if structured:
            found = fit_structured_broadband(found, inputs, orders)
    elif structured:
        found = fit_structured(inputs)
    else:
        found = fit_loops(inputs)
    report("free run", 0.95)
    begun = begun_as_conditioned(found.fit.model, found.records)
    if begun is not found.fit.model:
        notices += rest_notices(begun)
        found = replace(found, fit=replace(found.fit, model=begun))
    joint = _with_zero(found)
    phases = phase_errors(found.fit.model, experiment, roles)
    notices += [*found.notices, *_fit_notices(joint, found, roles, phases)]
    result = Identification(
        joint.model,
        joint,
        delay,
        found.dynamics,
        published,
        found.orders,
        found.comparisons,
        phases,
        tuple(notices),
        found.structure,
    )
    origin = _provenance_of(result, found, experiment, roles)
    return replace(result, model=replace(joint.stated_model, provenance=origin))


def _range_of_motion(records: Sequence[Record], roles: Roles) -> float:
    """Range of the displacement [m]; an error if drive or displacement do not move, or not for long enough."""
    moving = [records[i].size for i in roles.fitted if roles.contents[i].span > 0.0]
    if not moving:
        raise IdentificationError("the drive does not move in any record; expected loops, steps or noise")
    if max(moving) < FEWEST_SAMPLES:
        raise IdentificationError(
            f"got {counted(max(moving), 'sample')} in the longest record that moves, expected {FEWEST_SAMPLES} or more"
        )
    reach = max(float(np.ptp(r.displacement)) for r in records)
    if reach < STILL:
        raise IdentificationError("the displacement never changes; expected that of a stage that is driven")
    return reach


def _with_zero(found: FitOutcome) -> Fit:
    """The joint fit, whose model has the mean residual of the records as its zero."""
    zero = float(np.mean([e.mean() for e in residuals(found.fit.model, found.records)]))
    fit = replace(found.fit, model=found.fit.model.with_effect(Offset(y0=zero)))
    return replace(fit, converged=fit.converged or fit.cost <= AT_THE_FLOOR)


def _fit_notices(fit: Fit, found: FitOutcome, roles: Roles, phases: Sequence[PhaseError]) -> list[Notice]:
    """What a user should know about a fit before its model is used."""
    notices = [Notice("at_bound", f"{name} reached a bound of its range") for name in undetermined(fit)]
    if not fit.converged:
        text = f"the joint fit stopped after {counted(fit.iterations, 'linearisation')}, before it had converged"
        notices.insert(0, Notice("not_converged", text))
    if found.structure is None:
        notices += [
            Notice("not_identifiable", f"{a} and {b} are not determined separately; record whole loops", severe=True)
            for a, b, _ in correlated_pairs(fit, INSEPARABLE)
        ]
    notices += one_way(found.records, roles.fitted)
    if all(p.is_fitted for p in phases):
        text = "no phase was left out, so the errors are not prediction errors; leave one out with --held-out"
        notices.append(Notice("nothing_held_out", text))
    return notices


def _provenance_of(result: Identification, found: FitOutcome, experiment: Experiment, roles: Roles) -> dict[str, str]:
    """What the model file says about the data, its errors and the range in which the model was identified."""
    unseen = not all(p.is_fitted for p in result.phases)
    largest = max(p.rms for p in result.phases)
    origin = {
        **provenance(experiment, result.free_run_error, result.free_run_percent),
        **record_errors(largest, result.free_run_error, unseen),
        **identified_range(found.records, roles.fitted),
    }
    if roles.broadband:
        return origin
    periods = identified_periods(found.records[i].sample_period for i in roles.fitted)
    return {**origin, **periods, LAG_ERROR: f"{1.96 * lag(result.fit)[1]:.4g}"}
