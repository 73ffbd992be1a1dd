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

"""How a driver opens a recording in place of a device."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import RecordingError
from ...parameter import Row, Setting
from ..opening import Opening
from ..stage import Stage
from .stage import ReplayStage

PARAMETERS: tuple[Row, ...] = (
    Setting("experiment", "", "path of the recording"),
    Setting("repeat", False, "begin again after the last sample"),
    Setting(
        "subscribers", 0, "the replay begins when the topic samples has this number of subscribers", lower=0, upper=1000
    ),
)
"""Parameters of the driver, declared under ``replay.``."""


def open(values: Mapping[str, Any], opening: Opening) -> Stage:
    """Read the recording that `PARAMETERS` name and open it; PiezoError if it cannot be read."""
    path = values["experiment"]
    if not path:
        raise RecordingError("replay.experiment: got no path, expected that of a recording")
    return ReplayStage(
        opening.read(path),
        name=f"replay of {Path(path).name}",
        repeat=values["repeat"],
        sample_period=opening.sample_period,
    )
