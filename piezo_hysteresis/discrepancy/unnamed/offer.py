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

"""The search for a correction without a name, and the tests that it has to pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...blocks.block import Array
from ...effects import Creep, Offset, UnnamedCorrection, UnnamedPlays, UnnamedPositionMap, UnnamedRelaxation
from ...identification.identified_range import identified_range
from ...identification.training.joint_fit import FAILURES, LAST, PRECISE, joint
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from ...record import Experiment
from ..gap import gap_between
from ..search.baseline_setup import BaselineSetup
from ..search.candidate_refits import LEAST_GAIN
from .correction import Correction, corrections_in
from .held_out import HeldOut, held_out, rate_and_amplitude_groups

HEIGHTS = (15, 47)
"""Numbers of grid points of the position maps that are tried: smooth, and with a period of a tenth of the travel."""
PLAYS = 13
"""Number of plays, whose half widths grow by √2."""
REMOVES, WORSE = 0.5, 1.05
"""Smallest share of the gap on the test records that a correction must remove, and largest ratio of the error with it
to the larger of the error without it and the floor, in a test record."""
FEW = 10
"""Number of linearisations of a trial; few, because a correction is small and linear in its parameters."""


def best_correction(model: Model, setup: BaselineSetup, experiment: Experiment) -> Correction | None:
    """The best correction of a fitted model, with the results of its tests.

    Parameters
    ----------
    model : Model
        Fitted model, whose residual no effect explains.
    setup : BaselineSetup
        Records and floors.
    experiment : Experiment
        The records as they came.

    Returns
    -------
    Correction or None
        None if the records have only one rate or amplitude, if there is no test record, or if no form has a gain.
    """
    if not (setup.test_records and all(g.any() for g in rate_and_amplitude_groups(setup.training_data))):
        return None
    before = held_out(model, setup.training_data)
    found = [
        c
        for form in forms(model, setup.training_data)
        if (c := fitted_correction(model, form, before, setup.training_data))
    ]
    if not found:
        return None
    best = max(found, key=lambda c: min(c.gain_rate, c.gain_amplitude))
    return best if best.refusal else judged_on_test_records(best, model, setup, experiment)


def forms(model: Model, training_data: TrainingData) -> Iterator[UnnamedCorrection]:
    """Every form that is tried, switched off. All are small, passive, and have few parameters."""
    zero = model.with_effect(Offset()) if Offset.name in model else model
    positions = [y / model.displacement_scale for y in zero.free_run(training_data.records)]
    low, high = min(float(x.min()) for x in positions), max(float(x.max()) for x in positions)
    if not high > low:
        return
    for heights in HEIGHTS:
        yield UnnamedPositionMap(m=(0.0,) * heights, low=low, high=high)
    yield UnnamedPlays(c=(0.0,) * PLAYS, reach=0.5 * (high - low))
    (creep,) = Creep.starts(training_data.extent)
    yield UnnamedRelaxation(tau_min=creep["tau_min"], tau_max=creep["tau_max"])


def fitted_correction(
    model: Model, form: UnnamedCorrection, before: HeldOut, training_data: TrainingData
) -> Correction | None:
    """A form fitted jointly with the model, and its gain at rates and amplitudes left out; None if the fit fails.

    Parameters
    ----------
    model : Model
        Model fitted without the form.
    form : UnnamedCorrection
        The form, switched off.
    before : HeldOut
        Errors of the model without the form.
    training_data : TrainingData
        Records and floors.
    """
    try:
        if min(_gains(model.with_effect(form), form.name, before, training_data)) <= 0.0:
            return None
        fit = joint(model.with_effect(form), training_data, FEW)
        by_rate, by_amplitude = _gains(fit.model, form.name, before, training_data)
    except FAILURES:
        return None
    axes = [axis for axis, gain in (("rates", by_rate), ("amplitudes", by_amplitude)) if gain < LEAST_GAIN]
    (effect,) = corrections_in(fit.model)
    refusal = (
        f"a function of the {form.depends_on} reduces the logarithm of the squared error at {' and '.join(axes)} that "
        f"were not fitted by only {min(by_rate, by_amplitude):.2f} on average, and {LEAST_GAIN:g} is needed"
        if axes
        else ""
    )
    return Correction(effect, model.displacement_scale, None, by_rate, by_amplitude, None, 0.0, refusal)


def judged_on_test_records(
    correction: Correction, model: Model, setup: BaselineSetup, experiment: Experiment
) -> Correction:
    """The correction after the last fit to all samples, judged on the test records."""
    training_data, _ = setup.for_last_fit()
    try:
        fit = joint(model.with_effect(correction.effect), training_data, LAST, PRECISE)
        gap = gap_between(model, fit.model, setup, setup.test_records)
        everywhere = gap_between(fit.model, fit.model, setup, setup.usable)
    except FAILURES as error:
        return replace(correction, refusal=f"its last fit failed ({error})")
    removed, (effect,) = gap.explained, corrections_in(fit.model)
    found = replace(correction, effect=effect, gap=gap, removed=removed)
    if removed < REMOVES:
        needed = f"at least {100 * REMOVES:g} % is needed"
        refusal = f"it removes {100 * removed:.0f} % of the gap on the test records, and {needed}"
        return replace(found, refusal=refusal)
    if found.worst > WORSE:
        most = f"at most {100 * (WORSE - 1.0):.0f} % is allowed"
        refusal = f"it increases the error of a test record by {100 * (found.worst - 1.0):.0f} %, and {most}"
        return replace(found, refusal=refusal)
    stated = replace(gap, per_phase=everywhere.per_phase).stated_by(fit.stated_model, experiment)
    envelope = identified_range(setup.records, setup.fitted)
    return replace(found, model=replace(stated, provenance={**stated.provenance, **envelope}))


def _gains(model: Model, form: str, before: HeldOut, training_data: TrainingData) -> tuple[float, float]:
    """G at rates and at amplitudes that were left out."""
    after = held_out(model, training_data, form)
    return _gain(before.by_rate, after.by_rate), _gain(before.by_amplitude, after.by_amplitude)


def _gain(before: Array, after: Array) -> float:
    logs: Sequence[Array] = [np.log(np.maximum(1.0, errors**2)) for errors in (before, after)]
    return float(np.mean(logs[0] - logs[1]))
