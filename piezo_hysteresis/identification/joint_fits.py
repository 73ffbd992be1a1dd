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

"""The joint fits in free run that an experiment permits, with broadband records or with loops alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects import MEMORY
from ..errors import counted
from ..model.model import Model
from ..record import Notice, Record
from .fit.fit import Fit, Progress
from .fit.form_uncertainty import ADEQUACY, with_form_uncertainty
from .fit.gauge import Gauge
from .fit.joint import fit_dynamics, fit_joint, fit_lag, without_intersample_error
from .fit.normal_equations import Nuisance
from .left_out import score_left_out
from .records.conditioning import records_to_fit
from .records.leading_step import Blocks, steps_apart
from .records.noise import sensor_noise
from .records.roles import Roles
from .steps.comparison import InputComparison, compare_inputs
from .steps.dynamics import Dynamics, delay_of
from .steps.linear_start import form_of, hysteresis_signals
from .steps.order_choice import OrderError, choose_order, compare_orders
from .steps.remaining_lag import lag_notices
from .structure.broadband_part import BroadbandPart
from .structure.structure_choice import LEADS, StructureChoice, choose_structure

AT_THE_FLOOR = 1.5
"""Mean square of the residual, or of the error of prediction, in floors, up to which a model describes the records."""
HIGHEST_ORDER = 10
"""Highest model order of the comparison."""


@dataclass(frozen=True, eq=False, slots=True)
class FitInput:
    """What every joint fit starts from.

    Parameters
    ----------
    start : Model
        Model with a hysteresis fitted to the loops, and the delay that is known or one sample.
    records : tuple of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m].
    roles : Roles
        What each record is used for.
    reach : float
        Largest range of the displacement of a record [m].
    natural, gauge : Gauge
        Natural gauge of the records, in which the structure is chosen, and that of the result.
    report : callable
        Called with the name of the step and the fraction done.
    """

    start: Model
    records: tuple[Record, ...]
    floors: Sequence[float]
    roles: Roles
    reach: float
    natural: Gauge
    gauge: Gauge
    report: Progress


@dataclass(frozen=True, eq=False, slots=True)
class FitOutcome:
    """Result of a joint fit.

    Parameters
    ----------
    fit : Fit
        The fit, with intervals that contain the uncertainty of the model's form.
    records : tuple of Record
        The records without the inter-sample error of averages.
    notices : tuple of Notice
        Findings, in order.
    dynamics : Dynamics or None
        The linear dynamics that were estimated from broadband records.
    orders : tuple of OrderError
        Comparison of model orders.
    comparisons : tuple of InputComparison
        Comparison of the inputs of the ARX model.
    structure : StructureChoice or None
        The choice of the structure, if it was made.
    """

    fit: Fit
    records: tuple[Record, ...]
    notices: tuple[Notice, ...]
    dynamics: Dynamics | None = None
    orders: tuple[OrderError, ...] = ()
    comparisons: tuple[InputComparison, ...] = ()
    structure: StructureChoice | None = None


def fit_broadband(given: FitInput, delay: int | None, orders: tuple[int, int] | None) -> FitOutcome:
    """Fit hysteresis and ARX dynamics, which broadband records determine: the published model.

    Parameters
    ----------
    given : FitInput
        Start, records and floors.
    delay : int or None
        Delay in the response to a step, samples; None takes it from the dynamics.
    orders : (int, int) or None
        na and nb; None chooses them.
    """
    start, records, floors, roles = given.start, given.records, given.floors, given.roles
    given.report("step 2: dynamics", 0.2)
    signals = hysteresis_signals(start, records, roles.broadband)
    samples = delay_of(signals) if delay is None else delay
    table = compare_orders(signals, samples, start.sample_period, HIGHEST_ORDER)
    chosen = orders or (choose_order(table),) * 2

    def fit_behind(model: Model, samples: int) -> tuple[Fit, Dynamics, tuple[Notice, ...]]:
        def report(word: str, part: float) -> None:
            given.report(word, 0.3 + 0.2 * part)

        return fit_dynamics(model, records, floors, roles.fitted, roles.broadband, samples, chosen, report)

    fit, dynamics, of_dynamics = fit_behind(start, samples)
    notices = list[Notice]()
    if delay is None:
        # a better hysteresis gives a more accurate onset
        again = delay_of(hysteresis_signals(fit.model, records, roles.broadband))
        if again != samples:
            samples = again
            fit, dynamics, of_dynamics = fit_behind(fit.model, samples)
        message = f"no step was recorded; the delay of {counted(samples, 'sample')} was taken from the dynamics"
        notices.append(Notice("delay_from_fit", message))
    corrected, of_averages = without_intersample_error(fit.model, records, floors, roles.fitted)
    if corrected is not records:
        fit = fit_joint(fit.model, corrected, floors, roles.fitted)
    noise = [i for i in roles.broadband if records[i].is_named("noise")]
    comparisons, of_inputs = compare_inputs(fit.model, corrected, noise, samples, chosen)
    notices += [*of_dynamics, *of_averages, *of_inputs]
    fit = _with_form(fit, (corrected, floors, roles.fitted), given.reach)
    return FitOutcome(fit, corrected, tuple(notices), dynamics, table, comparisons)


def fit_structured_broadband(published: FitOutcome, given: FitInput, orders: tuple[int, int] | None) -> FitOutcome:
    """Choose the structure beside broadband records, unless the published model describes or predicts them as well.

    Parameters
    ----------
    published : FitOutcome
        Fit of hysteresis and ARX dynamics alone.
    given : FitInput
        Start, records and floors.
    orders : (int, int) or None
        Highest na and nb; None takes them from the comparison of orders.

    Raises
    ------
    ParameterError
        If G(1) of the gauge has the wrong sign for plays.
    """
    records, fitted = published.records, given.roles.fitted
    quiet, start = _quiet(records, given.reach), given.natural.of_model(published.fit.model)
    alone = score_left_out(start, records, quiet, fitted)
    if alone <= np.log(AT_THE_FLOOR):
        return published
    given.gauge.require_sign(given.natural)

    def report(word: str, part: float) -> None:
        given.report(word, 0.5 + 0.4 * part)

    highest = orders or (choose_order(published.orders),) * 2
    dynamics = BroadbandPart(start, records, given.roles.broadband, highest)
    choice = choose_structure(start, records, quiet, fitted, report, dynamics.fit, dynamics.fit)
    whole = score_left_out(choice.fit.model, records, quiet, fitted)
    said = (
        "on data left out of the fit, hysteresis with ARX dynamics has an error of "
        f"{np.exp(0.5 * alone):.3g} times the noise floor, and the structure chosen from all others one of "
        f"{np.exp(0.5 * whole):.3g}; "
    )
    margin = LEADS if MEMORY.name in choice.fit.model else -LEADS
    if not whole < alone + margin:
        return replace(published, notices=(*published.notices, Notice("structure", f"{said}the first is kept")))
    said += "the second is used"
    if not whole < alone:
        said += ": plays are preferred up to a small difference, because they stay inside the largest measured loop"
    fit, notices = given.gauge.of_fit(choice.fit), published.notices
    if form_of(fit.model)[2] != form_of(start)[2]:
        notices = tuple(n for n in notices if n.kind != "order_reduced")
    notices = (*notices, *choice.notices, Notice("structure", said))
    return replace(published, fit=fit, notices=notices, structure=replace(choice, fit=fit))


def _quiet(records: Sequence[Record], reach: float) -> list[float]:
    """Floors of the records from the noise of the sensor alone [m]."""
    return [max(noise, ADEQUACY * reach) for noise in sensor_noise(records)]


def fit_structured(given: FitInput) -> FitOutcome:
    """Choose the structure without broadband records, and fit it; `fit.model` has the gauge that was asked for.

    Parameters
    ----------
    given : FitInput
        Start, records and floors.

    Raises
    ------
    ParameterError
        If G(1) of the gauge has the wrong sign for plays.
    """
    given.gauge.require_sign(given.natural)
    start, records, roles = given.start, given.records, given.roles
    notices: tuple[Notice, ...] = ()
    if any(r.sample_period > 1.001 * start.sample_period for r in records):
        given.report("joint fit", 0.2)
        rough = fit_lag(start, *steps_apart(records, given.floors, roles.fitted))
        records, notices = without_intersample_error(rough.model, records, given.floors, roles.fitted)
    quiet = _quiet(records, given.reach)

    def report(word: str, part: float) -> None:
        given.report(word, 0.2 + 0.7 * part)

    choice = choose_structure(given.natural.of_model(start), records, quiet, roles.fitted, report)
    fit = given.gauge.of_fit(choice.fit)
    of_lag = lag_notices(fit, [roles.contents[i] for i in roles.fitted], rivals_counted=True)
    return FitOutcome(fit, records, (*notices, *choice.notices, *of_lag), structure=replace(choice, fit=fit))


def fit_loops(given: FitInput) -> FitOutcome:
    """Fit the hysteresis and a lag, which is all that loops determine."""
    records, floors, roles = given.records, given.floors, given.roles
    given.report("joint fit", 0.2)
    used = steps_apart(records, floors, roles.fitted)
    fit = fit_lag(given.start, *used)
    corrected, notices = without_intersample_error(fit.model, records, floors, roles.fitted)
    if corrected is not records:
        used = steps_apart(corrected, floors, roles.fitted)
        fit = fit_lag(fit.model, *used)
    fit = _with_form(fit, used, given.reach)
    of_lag = lag_notices(fit, [roles.contents[i] for i in roles.fitted], rivals_counted=False)
    return FitOutcome(fit, corrected, (*notices, *of_lag))


def _with_form(fit: Fit, used: Blocks, reach: float) -> Fit:
    """The fit with the uncertainty of the model's form in its covariance."""
    kept, sizes = records_to_fit(*used)
    return with_form_uncertainty(fit, kept, Nuisance(offset=True), sizes, sizes, reach)
