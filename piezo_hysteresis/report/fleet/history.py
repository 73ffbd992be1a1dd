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

"""`FleetHistory`: the results of many recordings of many stages, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ParameterSeries:
    """One parameter in all recordings that contain it.

    Parameters
    ----------
    unit : str
        SI unit.
    index : (k,) ndarray of int
        Indices of the recordings.
    value, lower, upper : (k,) ndarray
        Estimates and the ends of their 95 % intervals; NaN without an interval.
    """

    unit: str
    index: NDArray[np.intp]
    value: Array
    lower: Array
    upper: Array

    @property
    def standard_error(self) -> Array:
        """Standard errors of the estimates (k,), NaN without an interval.

        They come from the longer side of the interval, because a bound of the parameter may cut the other one.
        """
        return np.maximum(self.upper - self.value, self.value - self.lower) / 1.96


@dataclass(frozen=True, eq=False, slots=True)
class FleetHistory:
    """Recordings of one task, in the order of their time.

    Parameters
    ----------
    source : str
        Location of the results.
    task : str
        Name of the task.
    recording, stage, status, verdict, reason : (n,) ndarray of str
        Name, stage, status, verdict and error message; the last two may be empty.
    time : (n,) ndarray of datetime64
        Time of the recording; NaT if it is not known.
    error, floor : (n,) ndarray
        Free-run error and noise floor [% of range]; NaN if there is none.
    severe : (n,) ndarray of int
        Number of severe findings in the data.
    parameters : mapping of str to ParameterSeries
        Parameters by name; elements of arrays (``arx.a[0]``) are left out, because they are not identifiable.
    """

    source: str
    task: str
    recording: NDArray[Any]
    stage: NDArray[Any]
    status: NDArray[Any]
    verdict: NDArray[Any]
    reason: NDArray[Any]
    time: NDArray[np.datetime64]
    error: Array
    floor: Array
    severe: NDArray[np.int_]
    parameters: Mapping[str, ParameterSeries]

    @property
    def size(self) -> int:
        """Number of recordings."""
        return int(self.stage.size)

    @property
    def is_done(self) -> NDArray[np.bool_]:
        """True for recordings with a result, shape (n,)."""
        return np.asarray(self.status == "done")

    @property
    def stages(self) -> tuple[str, ...]:
        """Every stage once, in order."""
        return tuple(np.unique(self.stage).tolist())
