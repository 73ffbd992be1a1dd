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

"""`BACK_ENDS`: every kind of stage that a driver can open, by the value of the driver's parameter `stage`.

To support another device, add a folder beside this file that exports PARAMETERS and `open`, and a line to `BACK_ENDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError
from ..parameter import Row
from . import daqmx, gcs2, replay, simulated
from .opening import Opening
from .stage import Stage


@dataclass(frozen=True, slots=True)
class BackEnd:
    """One kind of stage.

    Parameters
    ----------
    rows : tuple of Parameter or Setting
        ROS parameters of the stage, declared under the prefix ``"<word>."``.
    open : callable
        Makes the stage from the values of the rows and an `Opening`.
    is_device : bool
        True for hardware. It is locked by the name of the device and runs in real time.
    has_keeper : bool
        True if a second process can bring the device to its safe voltage.
    keeper_ends_driver : bool
        True if that process can do so only after the driver has ended, because the device serves one process at a time.
    """

    rows: tuple[Row, ...]
    open: Callable[[Mapping[str, Any], Opening], Stage]
    is_device: bool
    has_keeper: bool = False
    keeper_ends_driver: bool = False


BACK_ENDS: Mapping[str, BackEnd] = {
    "simulated": BackEnd(simulated.PARAMETERS, simulated.open, is_device=False),
    "replay": BackEnd(replay.PARAMETERS, replay.open, is_device=False),
    "gcs2": BackEnd(gcs2.PARAMETERS, gcs2.open, is_device=True, has_keeper=True),
    "nidaqmx": BackEnd(daqmx.PARAMETERS, daqmx.open, is_device=True, has_keeper=True, keeper_ends_driver=True),
}
"""Every back end by the value of the parameter `stage`."""


def open_stage(word: str, values: Mapping[str, Any], opening: Opening) -> Stage:
    """Open a stage at a sample period.

    Parameters
    ----------
    word : str
        Key of `BACK_ENDS`.
    values : mapping
        Values of its parameters, by name.
    opening : Opening
        Sample period and speed; the reader of recordings for `replay`.

    Raises
    ------
    PiezoError
        If the stage cannot be opened with these values. A stage that was opened is closed again.
    """
    if opening.real_time_factor != 1.0 and BACK_ENDS[word].is_device:
        raise ParameterError(
            f"real_time_factor: got {opening.real_time_factor:g} for stage '{word}', expected 1; a device runs in real "
            "time"
        )
    stage = BACK_ENDS[word].open(values, opening)
    try:
        stage.configure(opening.sample_period or stage.sample_period)
    except BaseException:
        stage.close()
        raise
    return stage
