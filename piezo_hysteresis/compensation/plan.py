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

"""`Plan`: the drive for a path, whether the path is reachable, and the expected error, before the stage moves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModelError
from ..identification.identified_range import outside_of
from ..model.chain import ChainState
from ..model.model import Model
from ..model.samples import samples
from ..record import Record
from .approach import APPROACH, settled_start, smooth_transition, transition_samples
from .band import Band
from .expected_error import ExpectedError, error_after_drive, free_run_error, parameter_error
from .inverse import Inverse
from .limit_check import reachable
from .limits import Limits
from .nearest_path import nearest_path
from .reachability import Reachability

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """The planned drive and the expected result.

    Parameters
    ----------
    wanted : (n,) ndarray
        The path [m].
    voltage : (m,) ndarray
        Drive [V]: the approach, the preview, the path, and the way back if there is one.
    predicted : (m,) ndarray
        Displacement that the complete model predicts for the drive [m].
    begin : int
        Index of the drive sample at which the path begins.
    sample_period : float
        Sample period [s].
    reachability : Reachability
        Reachability of the approach and the path. The times of its parts count from the start of the path.
    expected : ExpectedError
        Expected error along the path.
    left_out, not_on_path : tuple of str
        Effects that have no inverse, and effects that the drive voltage does not influence.
    preview : int
        Number of samples by which the drive is ahead of the path.
    start, end : ChainState
        State of the model before and after the drive.
    band : Band
        Low-pass filter of the path.
    beyond : tuple of str
        Where the drive leaves what the model was identified on; the error can exceed the expected one there.
    start_is_known : bool
        False if the stage was driven before its voltages were received: the error can then exceed the expected one.
    after_drive : float
        RMS change of the displacement along the path, apart from its mean, if the stage was driven over the range of
        the model before, so that it does not begin in `start` [m].
    """

    wanted: Array
    voltage: Array
    predicted: Array
    begin: int
    sample_period: float
    reachability: Reachability
    expected: ExpectedError
    left_out: tuple[str, ...]
    not_on_path: tuple[str, ...]
    preview: int
    start: ChainState
    end: ChainState
    band: Band
    beyond: tuple[str, ...] = ()
    start_is_known: bool = True
    after_drive: float = 0.0

    @property
    def path_predicted(self) -> Array:
        """Displacement expected along the path, shape (n,) [m]."""
        return self.predicted[self.begin : self.begin + self.wanted.size]

    @property
    def largest_slew(self) -> float:
        """Largest rate of change of the drive [V/s]."""
        return float(np.abs(np.diff(self.voltage)).max(initial=0.0)) / self.sample_period

    @property
    def range(self) -> float:
        """Range of the path [m]."""
        return float(np.ptp(self.wanted))


def _way_back(last: float, rest: float, duration: float, limits: Limits, period: float) -> Array:
    """Drive from `last` to `rest` [V] inside the slew limit, shape (k,), without the first; empty for no duration."""
    if duration == 0.0:
        return np.empty(0)
    steepest = 0.5 * np.pi * abs(rest - last)  # largest slope of a half cosine, times its duration
    count = max(round(duration / period), math.ceil(1.001 * steepest / limits.max_slew_rate / period), 1)
    return np.append(smooth_transition(last, rest, count)[1:], rest)


def plan(
    model: Model,
    wanted: ArrayLike,
    limits: Limits,
    *,
    start: ChainState | None = None,
    approach: float = APPROACH,
    way_back: float = 0.0,
    band: Band | None = None,
    approximate: bool = False,
) -> Plan:
    """Plan the drive for a path, from the model alone.

    Parameters
    ----------
    model : Model
        Model of the stage.
    wanted : (n,) array_like
        Displacement at the model's sample period [m].
    limits : Limits
        Limits of the drive.
    start : ChainState, optional
        State of the model now. Default: at rest at 0 V, or at the limit that is nearest to it.
    approach : float
        Duration of the smooth approach from the present position to the first sample of the path [s], at least 200
        samples; 0 for none.
    way_back : float
        Duration of the smooth return to the voltage at which the drive began [s]; longer if the slew limit requires it.
        Default 0: the last voltage is held.
    band : Band, optional
        Low-pass filter of the path. Default: `Band.of` the sample period of the model.
    approximate : bool
        Leave out effects that cannot be inverted instead of refusing the model.

    Returns
    -------
    Plan

    Raises
    ------
    ModelError
        If the path is empty or not finite, or the model cannot be inverted.
    """
    y, limits = samples(wanted, "displacement"), limits.resolved
    for name, duration in (("approach", approach), ("way_back", way_back)):
        if not 0.0 <= duration < math.inf:
            raise ModelError(f"{name}: got {duration!r} s, expected zero or a finite time")
    state = start or settled_start(model, limits)
    band = band or Band.of(model.sample_period)
    at = float(model.run([state.inputs[0]], state)[0][0])
    way = smooth_transition(at, float(y[0]), transition_samples(approach, model.sample_period))
    whole = np.concatenate((way, y))
    found = reachable(model, limits, whole, start=state, band=band, approximate=approximate, approach=way.size)
    if found.parts:  # what is changed is the path alone: the approach begins where the stage is
        nearest = nearest_path(model, limits, y, state, band=band, approximate=approximate, approach=approach)
        found = replace(found, nearest=nearest)
    late = way.size * model.sample_period
    parts = tuple(replace(part, begin=part.begin - late, end=part.end - late) for part in found.parts)
    found = replace(found, parts=parts)
    inverse = Inverse(model, limits, band=band, approximate=approximate)
    back = _way_back(float(found.voltage[-1]), state.inputs[0], way_back, limits, model.sample_period)
    voltage = np.concatenate((found.voltage, back))
    predicted, end = model.run(voltage, state)
    begin = way.size + inverse.preview
    along = slice(begin, begin + y.size)
    off = predicted[along] - y
    expected = ExpectedError(
        float(np.sqrt(np.mean(off**2))),
        free_run_error(model),
        parameter_error(model, voltage, along),
    )
    return Plan(
        y,
        voltage,
        predicted,
        begin,
        model.sample_period,
        found,
        expected,
        inverse.left_out,
        inverse.not_on_path,
        inverse.preview,
        state,
        end,
        band,
        tuple(said.message for said in outside_of(model, Record(voltage, voltage, model.sample_period))),
        after_drive=error_after_drive(model, voltage, predicted, along, state),
    )
