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

"""`FleetHistory`: what many recordings of many stages gave, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ParameterSeries:
    """One parameter in the recordings that have it.

    Parameters
    ----------
    unit : str
        SI unit.
    index : (k,) ndarray of int
        Which recordings.
    value, lower, upper : (k,) ndarray
        Estimates and the ends of their 95 % intervals; the ends NaN where there is none.
    """

    unit: str
    index: NDArray[np.intp]
    value: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False, slots=True)
class FleetHistory:
    """Recordings of one task, in the order of their time.

    Parameters
    ----------
    source : str
        Where the results lie.
    task : str
        What was done with each recording.
    recording, stage, status, verdict, reason : (n,) ndarray of str
        Name, stage, what became of it, the verdict and the error text; the last two may be empty.
    time : (n,) ndarray of datetime64
        When it was taken; NaT where that is not known.
    error, floor : (n,) ndarray
        Free-run error and its floor [% of range]; NaN where there is none.
    parameters : mapping of str to ParameterSeries
        By name; numbers of arrays (``arx.a[0]``) are left out, because single ones are not identifiable.
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
    parameters: Mapping[str, ParameterSeries]

    @property
    def size(self) -> int:
        """Number of recordings."""
        return int(self.stage.size)

    @property
    def is_done(self) -> NDArray[np.bool_]:
        """Which recordings have a result, shape (n,)."""
        return np.asarray(self.status == "done")

    @property
    def stages(self) -> tuple[str, ...]:
        """Every stage once, in order."""
        return tuple(np.unique(self.stage).tolist())
