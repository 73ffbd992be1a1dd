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

"""`same_stage`: diagnosis of a stage that differs from a given model in one parameter only."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...effects import ExtraResonance, Softening, ThermalDrift
from ...errors import DivergenceError, ModelError, ParameterError
from ...identification.fit.normal_equations import Nuisance
from ...identification.records.comparable import comparable
from ...identification.records.noise_floor import floors, noise_floors, stroke
from ...model.model import Model
from ...model.provenance import MOVING, data_hash, known_error, with_stated_error
from ...record import Experiment, Notice, Record
from ..diagnosis import Diagnosis
from ..gap import measure_gap
from ..residual.localise import located
from ..verdict import Conclusion
from .change_kinds import KINDS, LEAVES, ParameterChange
from .parameter_changes import find_change, is_unchanged
from .signatures import DRIFT_TIME, creep_numbers, loop_numbers, shaped_model

HASH = "data_hash"
"""Key of the provenance."""
UNCHANGED = "unchanged"
"""Kind of the notice that the given model is still as good as when it was identified."""
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
"""Units of time."""


def same_stage(
    experiment: Experiment,
    model: Model,
    used: Sequence[int],
    progress: Callable[[float], None],
    given: Experiment | None = None,
) -> Diagnosis | Notice | None:
    """Name the parameter that has changed since `model` was identified.

    The data that the model was identified from show no change.

    Parameters
    ----------
    experiment : Experiment
        Experiment after the change.
    model : Model
        Model identified before the change, from other data.
    used : sequence of int
        Indices of the records to explain.
    progress : callable
        Called with the fraction done.
    given : Experiment, optional
        The experiment as it was recorded, if `experiment` has been prepared.

    Returns
    -------
    Diagnosis, Notice or None
        The finding that nothing has changed, if the error is the known one; None if no change explains the records.
    """
    records = experiment.records
    recorded = experiment if given is None else given
    hashes = {data_hash(e) for e in (experiment, recorded, comparable(recorded)[0])}
    if model.provenance.get(HASH) in hashes or not used:
        return None
    least = floors(records, noise_floors(records))
    known = known_error(model, MOVING)
    limits = np.maximum(least, known).tolist()
    try:
        if known and is_unchanged(model, records, used, limits):
            return Notice(
                UNCHANGED,
                "nothing has changed since the model was identified: apart from its zero, gain and loop height, which "
                f"differ from day to day, its error is within the known error of {1e9 * known:.3g} nm; what is missing "
                "now was missing then",
            )
        change = find_change(model, records, used, limits, progress)
        if change is None:
            return None
        changed = changed_model(model, change, records)
        free = Nuisance(offset=True)
        where = located(model, records, used, least.tolist(), free)
        gap = measure_gap((model, changed), records, list(used), least.tolist(), stroke(records), (free, free), False)
    except (DivergenceError, ModelError, ParameterError):
        return None
    if not gap.after < gap.before:
        return None
    return Diagnosis(
        conclusion=Conclusion.CHANGED_PARAMETER,
        reason=sentence_of(change),
        model=with_stated_error(changed, gap.live, stroke(records)),
        baseline=model,
        selection=None,
        fit=None,
        where=where,
        gap=gap,
        next_experiment=None,
        experiment=experiment,
        change=change,
    )


def sentence_of(change: ParameterChange) -> str:
    """The change in a few sentences, with its size and interval."""
    kind = change.kind
    numbers = change.size, *change.time_constants
    size = _with_interval([abs(n) for n in numbers] if change.key == "delay" else numbers, kind.unit)
    if kind.is_filter:
        size += f", cut-off frequency {0.5 / np.pi / change.size:.4g} Hz"
    words = [kind.words.format(how="later" if change.size > 0.0 else "earlier", size=size)]
    words += [KINDS[key].words.format(size=_with_interval(also, KINDS[key].unit)) for key, also in change.also.items()]
    late = f" It delays slow signals by {_with_interval(change.lag, 's')}." if kind.damping else ""
    what = ", ".join(f"{k.name} ({k.family})" for k in (kind, *(KINDS[key] for key in change.also)))
    names = change.others
    alike = f" It cannot be distinguished from {' and '.join(names)} in these records." if names else ""
    left = "" if change.after < LEAVES else " The remaining error is above the known error, so the form is not certain."
    return f"The stage is the same, but {' and '.join(words)}: {what}.{late}{alike}{left}"


def _with_interval(numbers: Sequence[float], unit: str) -> str:
    """A value and its 95 % interval in a readable unit."""
    factor = 1.0
    if unit == "s":
        factor, unit = next((f, u) for f, u in UNITS if abs(numbers[0]) >= f or f == UNITS[-1][0])
    elif unit == "1":
        factor, unit = 0.01, "%"
    elif unit == "m":
        factor, unit = 1e-9, "nm"
    value, *ends = (n / factor for n in numbers)
    low, high = sorted(ends)
    return f"{value:.4g} {unit} (95 %: {low:.4g} to {high:.4g} {unit})"


def changed_model(model: Model, change: ParameterChange, records: Sequence[Record]) -> Model:
    """The given model with the change, and with the new gain and loop height."""
    values = model.values()
    gain, loop = change.session.get("gain", 0.0), change.session.get("loop", 0.0)
    numbers = {n: v * (1.0 + loop) for n, v in loop_numbers(model).items()} if loop else {}
    if change.kind.family == "lag":
        model = shaped_model(model, change.key, change.size)
    elif change.kind.name == ExtraResonance.name:
        name = f"{ExtraResonance.name}.f0"
        numbers[name] = values[name] + change.size
    elif change.kind.name == ThermalDrift.name:
        longest = max(r.duration for r in records)
        tau = max(1.0, DRIFT_TIME * longest)
        model = model.with_effect(ThermalDrift(D=-change.size / float(np.expm1(-longest / tau)), tau=tau))
    elif change.kind.name == Softening.name:
        # the coefficient applies to the cube of the displacement, the fit used the cube of the drive
        span = stroke(records)
        cubic = next((n for n in model.hysteresis.linear_numbers() if n == "p1"), None)
        if cubic is not None:
            top = max(float(np.abs(r.voltage).max()) for r in records) / model.voltage_scale
            slope = span / model.displacement_scale / top
            name = f"{model.hysteresis.name}.{cubic}"
            numbers[name] = values[name] - change.size * slope**3 * (model.displacement_scale / span) ** 2
    else:
        numbers |= {
            n: v * (1.0 + change.size) for n, v in creep_numbers(model).items() if change.key not in ("gain", "loop")
        }
    model = model.with_values(numbers)
    return replace(model, displacement_scale=model.displacement_scale * (1.0 + gain))
