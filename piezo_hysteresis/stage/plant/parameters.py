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

"""`PlantParameters`: everything that defines a simulated stage, from and to a mapping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ...errors import ParameterError
from ...parameter import Parameter, Value
from .creep import PlantCreep
from .electronics import Electronics
from .environment import Environment
from .hysteresis import Hysteresis
from .quantity import SOURCE, Group
from .sensor import Sensor
from .structure import Structure

_GROUPS: dict[str, type[Group]] = {
    "electronics": Electronics,
    "hysteresis": Hysteresis,
    "creep": PlantCreep,
    "structure": Structure,
    "sensor": Sensor,
    "environment": Environment,
}
"""Parts of the plant by name."""

_SUB_STEP = Parameter("sub_step", "δ", "s", 5e-6, 1e-8, 1e-3, "longest internal step of the simulation", SOURCE)
"""Longest internal step of the plant."""


@dataclass(frozen=True)
class PlantParameters:
    """The simulated stage, part by part in the order of the chain, in SI units. Hidden effects are off by default.

    Parameters
    ----------
    electronics, hysteresis, creep, structure, sensor, environment : Group
        The parts.
    sub_step : float
        Longest internal step of the simulation [s].

    Raises
    ------
    ParameterError
        If the full stroke does not fit the sensor, the drive limits do not fit the converter, or a softened spring
        cannot carry the load.

    Examples
    --------
    >>> PlantParameters().with_values({"creep.gamma": 0.015}).creep.gamma
    0.015
    """

    electronics: Electronics = field(default_factory=Electronics)
    hysteresis: Hysteresis = field(default_factory=Hysteresis)
    creep: PlantCreep = field(default_factory=PlantCreep)
    structure: Structure = field(default_factory=Structure)
    sensor: Sensor = field(default_factory=Sensor)
    environment: Environment = field(default_factory=Environment)
    sub_step: float = 5e-6

    def __post_init__(self) -> None:
        object.__setattr__(self, "sub_step", _SUB_STEP.check(self.sub_step))
        e = self.electronics
        if not -e.dac_range <= e.voltage_min < e.voltage_max <= e.dac_range:
            raise ParameterError(
                f"electronics: got voltage_min {e.voltage_min:g} V and voltage_max {e.voltage_max:g} V, expected them "
                f"ordered and within ±{e.dac_range:g} V, the range of the converter"
            )
        ends = self.stroke(0.0, e.voltage_min), self.stroke(0.0, e.voltage_max)
        for end in ends:
            self.structure.static_mode1(end, abs(ends[1] - ends[0]))
        reach = max(map(abs, ends))
        if reach > self.sensor.range:
            raise ParameterError(
                f"sensor.range: got ±{self.sensor.range:g} m for a stage that reaches {reach:g} m, expected at least "
                "that; enlarge sensor.range or reduce structure.displacement_scale"
            )

    def stroke(self, start: float, stop: float) -> float:
        """Displacement when the settled stage goes slowly from drive `start` to `stop` [V], without creep [m]."""
        return self.structure.gain * self.hysteresis.rise(start, stop)

    @property
    def full_stroke(self) -> float:
        """Displacement from the lowest to the highest drive [m]; noise and nonlinearities are relative to it."""
        return abs(self.stroke(self.electronics.voltage_min, self.electronics.voltage_max))

    @classmethod
    def table(cls) -> tuple[Parameter, ...]:
        """Every quantity with its default, named ``part.quantity``, for ROS descriptors and documentation."""
        rows = (replace(row, name=f"{part}.{row.name}") for part, group in _GROUPS.items() for row in group.table())
        return (*rows, _SUB_STEP)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> PlantParameters:
        """Defaults changed by a mapping, nested or with dotted keys, as a YAML file gives it.

        ``hysteresis.operator`` may be ``bouc_wen`` (default) or ``prandtl_ishlinskii``; the other values of the part
        then change the defaults of that operator.

        Raises
        ------
        ParameterError
            On an unknown name or a value that is not acceptable.
        """
        flat = _flatten(mapping)
        operator = flat.pop("hysteresis.operator", "bouc_wen")
        if operator not in ("bouc_wen", "prandtl_ishlinskii"):
            raise ParameterError(f"hysteresis.operator: got {operator!r}, expected bouc_wen or prandtl_ishlinskii")
        hysteresis = Hysteresis() if operator == "bouc_wen" else Hysteresis.prandtl_ishlinskii()
        return cls(hysteresis=hysteresis).with_values(flat)

    def with_values(self, values: Mapping[str, Any]) -> PlantParameters:
        """The same stage with some quantities changed, named ``part.quantity``.

        Raises
        ------
        ParameterError
            On an unknown name or a value that is not acceptable.
        """
        changes: dict[str, dict[str, Any]] = {}
        flat = _flatten(values)
        sub_step = flat.pop("sub_step", self.sub_step)
        for name, value in flat.items():
            part, _, quantity = name.partition(".")
            known = {row.name for row in _GROUPS[part].table()} if part in _GROUPS else set()
            if quantity not in known:
                expected = f"part.quantity, part: {', '.join(_GROUPS)}"
                if known:
                    expected = f"one of {', '.join(f'{part}.{name}' for name in sorted(known))}"
                elif "ros__parameters" in name.split("."):
                    expected = "names without the heading of a ROS node, e.g. 'creep.gamma: 0.015'"
                raise ParameterError(f"{name!r}: unknown quantity of the simulated stage, expected {expected}")
            changes.setdefault(part, {})[quantity] = value
        parts = {part: replace(getattr(self, part), **new) for part, new in changes.items()}
        return replace(self, sub_step=sub_step, **parts)

    def to_mapping(self) -> dict[str, Value]:
        """Every quantity by its dotted name; `from_mapping` gives back an equal stage."""
        values: dict[str, Value] = {}
        for part, group in _GROUPS.items():
            for row in group.table():
                values[f"{part}.{row.name}"] = getattr(getattr(self, part), row.name)
        return {**values, "sub_step": self.sub_step}


def _flatten(mapping: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            flat.update(_flatten(value, f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = value
    return flat
