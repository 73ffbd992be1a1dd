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

"""`BackEnd`: a kind of stage that a driver can open. `Opening`: sample period and speed with which it is opened."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import StageError
from ..parameter import Row
from ..record import Record
from .stage import Stage


def _no_reader(path: str) -> Iterable[Record]:
    raise StageError(f"{path}: this program reads no recordings, expected a stage other than 'replay'")


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
    assumes_voltage : bool
        Whether a stage may assume its voltage where the values allow this; otherwise it is read, or the stage refuses
        to open with an UnknownVoltageError. A keeper assumes nothing.
    """

    sample_period: float = 0.0
    real_time_factor: float = 1.0
    read: Callable[[str], Iterable[Record]] = _no_reader
    assumes_voltage: bool = True


@dataclass(frozen=True, slots=True)
class BackEnd:
    """One kind of stage, as a folder of `stage` exports it under the name ``BACK_END``.

    Parameters
    ----------
    word : str
        Value of the driver's parameter `stage` that selects it.
    rows : tuple of Parameter or Setting
        ROS parameters of the stage, declared under the prefix ``"<word>."``.
    open : callable
        Function that opens the stage from the values of the rows and an `Opening`.
    is_device : bool
        True for hardware. It is locked by the name of the device and runs in real time.
    has_keeper : bool
        True if a second process can bring the device to its safe voltage.
    keeper_ends_driver : bool
        True if that process can do so only after the driver has ended, because the device serves one process at a time.
    """

    word: str
    rows: tuple[Row, ...]
    open: Callable[[Mapping[str, Any], Opening], Stage]
    is_device: bool
    has_keeper: bool = False
    keeper_ends_driver: bool = False
