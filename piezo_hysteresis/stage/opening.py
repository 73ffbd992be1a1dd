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

"""`Opening`: how a driver opens a stage, in addition to the values of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..errors import StageError
from ..record import Record


def _no_reader(path: str) -> Iterable[Record]:
    raise StageError(f"{path}: this program reads no recordings, expected another stage than 'replay'")


@dataclass(frozen=True, slots=True)
class Opening:
    """Requested sample period and speed of a stage.

    Parameters
    ----------
    sample_period : float
        Time between samples [s]; 0 for the default of the stage.
    real_time_factor : float
        Simulated or replayed seconds per second; 1 for every device.
    read : callable
        Reads the records of a recording from its path. (Stages do not import the readers of recordings.)
    """

    sample_period: float = 0.0
    real_time_factor: float = 1.0
    read: Callable[[str], Iterable[Record]] = _no_reader
