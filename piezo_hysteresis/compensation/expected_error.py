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

"""`ExpectedError`: the expected deviation of the stage from the path, computed before anything moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..identification.identified_range import HIGHEST, LOWEST
from ..model.chain import ChainState
from ..model.model import Model
from ..record import Record
from .approach import smooth_transition

Array = NDArray[np.float64]

LEG = 0.1
"""Duration of each of the three legs of an earlier drive [s], or two samples if they are longer."""


@dataclass(frozen=True, slots=True)
class ExpectedError:
    """Expected RMS error on a path [m]: that of the plan, and that of the model.

    Parameters
    ----------
    planned : float
        RMS difference between the wanted displacement and the simulation of the plan [m]. Its causes are the band, the
        limits, and effects that were left out or inverted approximately.
    free_run : float or None
        Free-run error of the model on data that were not fitted [m]; None if the model file does not contain it.
    parameters : float or None
        Error on the path from the uncertainty of the parameters [m]; None if the model file does not contain a
        covariance.
    """

    planned: float
    free_run: float | None
    parameters: float | None

    @property
    def total(self) -> float:
        """Root of the sum of squares of `planned` and the larger one of `free_run` and `parameters` [m].

        The free-run error was measured, and already includes the error from the parameters on that drive. Their
        uncertainty on this path can be larger, where the path goes beyond what was recorded or the records determine
        some parameters only together.
        """
        model = max(self.free_run or 0.0, self.parameters or 0.0)
        return float(np.hypot(self.planned, model))

    def as_dict(self) -> Mapping[str, float | None]:
        """The numbers by name for JSON [m]."""
        return {
            "planned_m": self.planned,
            "free_run_m": self.free_run,
            "parameters_m": self.parameters,
            "total_m": self.total,
        }


def free_run_error(model: Model) -> float | None:
    """Free-run error in the model file [m]; None if there is none."""
    try:
        value = float(model.provenance["free_run_error"])
    except (KeyError, ValueError):
        return None
    return value if np.isfinite(value) and value >= 0.0 else None


def parameter_error(model: Model, voltage: Array, along: slice) -> float | None:
    """Standard error of the displacement since the rest before a drive [V], as RMS over a part of the drive [m].

    It follows from the covariance of the parameters; None if the model has none. The displacement at rest itself is not
    part of it, because the zero of the sensor is measured there.
    """
    known = model.covariance
    if known is None:
        return None
    record, found, rest = Record(voltage, np.zeros_like(voltage), model.sample_period), np.empty(voltage.size), None
    for _, part, _, names, slopes in model.linearise([record], known.names):
        rest = slopes[:, :1].copy() if rest is None else rest
        found[part] = known.errors_with(names, slopes - rest)
    return float(np.sqrt(np.mean(found[along] ** 2)))


def error_after_drive(model: Model, voltage: Array, predicted: Array, along: slice, start: ChainState) -> float:
    """RMS change of the displacement over a part of a drive [V], apart from its mean, after an earlier drive [m].

    `predicted` is the displacement for the drive from the state `start` [m].
    The earlier drive goes from the state `start` to the highest voltage on which the model was identified, to the
    lowest one, and back. A model without this range is driven over the range of `voltage`.
    """
    rest, count = float(start.inputs[0]), max(round(LEG / model.sample_period), 2)
    high, low = (float(model.provenance.get(key, end(voltage))) for key, end in ((HIGHEST, np.max), (LOWEST, np.min)))
    legs = ((rest, high), (high, low), (low, rest))
    earlier = np.concatenate([smooth_transition(begin, end, count) for begin, end in legs] + [np.array([rest])])
    chain = model.at(model.sample_period)
    driven = chain.resume(replace(model.run(earlier, start)[1], time=start.time))  # a drift would be another one later
    return float(np.std((model.run(voltage, driven)[0] - predicted)[along]))
