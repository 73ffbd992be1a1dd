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

To support another device, add a folder beside this file whose `__init__.py` exports a `BackEnd` as ``BACK_END``. It is
found here without being listed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from ..errors import ParameterError
from .description import Description
from .opening import BackEnd, Opening
from .stage import Stage


def _found() -> list[BackEnd]:
    """The back end of every folder that exports one."""
    folders = [import_module(f"{__package__}.{f.name}") for f in iter_modules([str(Path(__file__).parent)]) if f.ispkg]
    return [folder.BACK_END for folder in folders if hasattr(folder, "BACK_END")]


BACK_ENDS: Mapping[str, BackEnd] = {b.word: b for b in sorted(_found(), key=lambda b: (b.is_device, b.word))}
"""Every back end by the value of the parameter `stage`; devices come last."""


def open_stage(
    word: str,
    values: Mapping[str, Any],
    opening: Opening,
    lock: Callable[[Description], None] = lambda found: None,
    ramp_rate: float = math.inf,
) -> Stage:
    """Open a stage at a sample period.

    Parameters
    ----------
    word : str
        Key of `BACK_ENDS`.
    values : mapping
        Values of its parameters, by name.
    opening : Opening
        Sample period and speed; the reader of recordings for `replay`.
    lock : callable, optional
        Takes the description of the stage before anything else is done with it. If it raises an error, the stage is
        released as it was found, because another program drives it.
    ramp_rate : float, optional
        Rate of the way to the safe voltage [V/s] until `Stage.restrict` sets another one; by default, and at most, the
        steepest slew of the stage.

    Raises
    ------
    PiezoError
        If the stage cannot be opened with these values. A stage that was opened is closed again, at `ramp_rate`.
    """
    if opening.real_time_factor != 1.0 and BACK_ENDS[word].is_device:
        raise ParameterError(
            f"real_time_factor: got {opening.real_time_factor:g} for stage '{word}', expected 1; a device runs in real "
            "time"
        )
    stage = BACK_ENDS[word].open(values, opening)
    try:
        lock(stage.description)
    except BaseException:
        stage.leave()
        raise
    try:
        stage.restrict(stage.description, ramp_rate)
        stage.configure(opening.sample_period or stage.sample_period)
    except BaseException:
        stage.close()
        raise
    return stage
