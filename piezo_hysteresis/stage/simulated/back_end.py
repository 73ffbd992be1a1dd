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

"""How a driver opens a simulated stage."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import RecordingError, StageError
from ...home_path import in_home
from ...parameter import Parameter, Row, Setting
from ...yaml_file import read_yaml
from ..hidden import hidden_effect
from ..opening import Opening
from ..plant import PlantParameters
from ..stage import Stage
from .stages import SimulatedMemoryStage, SimulatedStage

_PLANT = PlantParameters.table()
"""Parameters of the simulated plant."""

PARAMETERS: tuple[Row, ...] = (
    Setting("seed", 0, "seed of the noise and of all random phases", lower=0, upper=2**31 - 1),
    Setting("memory", False, "true for a stage with on-board memory, which plays and records whole waveforms"),
    Setting("longest_block", 32768, "largest number of samples in the memory", lower=2, upper=2**31 - 1),
    Parameter("dead_time", "t_d", "s", 0.05, 0.0, 100.0, "time that arming a waveform takes", "simulated plant"),
    Setting("hidden_effect", -1, "seed that draws a hidden effect; -1: no hidden effect", lower=-1, upper=2**31 - 1),
    Setting(
        "plant_file", "", "YAML file of plant parameters; all other plant parameters of the driver are then ignored"
    ),
    Setting("hysteresis.operator", "bouc_wen", "kind of hysteresis of the plant", ("bouc_wen", "prandtl_ishlinskii")),
    *_PLANT,
)
"""Parameters of the driver, declared under ``simulated.``."""


def open(values: Mapping[str, Any], opening: Opening) -> Stage:
    """Make a simulated stage from the values of `PARAMETERS`; PiezoError if they are invalid."""
    period = {"sample_period": opening.sample_period} if opening.sample_period else {}
    named = {"seed": values["seed"], **period}
    plant = PlantParameters.from_mapping(_plant_values(values))
    if values["hidden_effect"] >= 0:
        plant = hidden_effect(values["hidden_effect"], plant).parameters
    if values["memory"]:
        return SimulatedMemoryStage(
            plant,
            longest_block=values["longest_block"],
            dead_time=values["dead_time"],
            real_time_factor=opening.real_time_factor,
            **named,
        )
    return SimulatedStage(plant, **named)


def _plant_values(values: Mapping[str, Any]) -> Mapping[str, Any]:
    if values["plant_file"]:
        return _read_mapping(in_home(values["plant_file"]))
    changed = {row.name: values[row.name] for row in _PLANT if values[row.name] != row.value}
    return {"hysteresis.operator": values["hysteresis.operator"], **changed}


def _read_mapping(path: Path) -> Mapping[str, Any]:
    try:
        mapping = read_yaml(path)
    except RecordingError as error:
        raise StageError(f"simulated.plant_file: {error}") from None
    if not isinstance(mapping, Mapping):
        raise StageError(f"simulated.plant_file: {path} holds no mapping, expected plant parameters by name")
    return mapping
