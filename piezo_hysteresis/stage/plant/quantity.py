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

"""`quantity`: a number of the plant with unit, bounds and meaning; `Group`: a part of the plant made of them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from ...errors import ParameterError
from ...parameter import Parameter

SOURCE = "simulated plant"
"""Source of the parameters of the plant."""


def quantity(value: float | tuple[float, ...], unit: str, lower: float, upper: float, meaning: str) -> Any:
    """A dataclass field whose metadata carry its unit, inclusive bounds and meaning."""
    return field(default=value, metadata={"unit": unit, "lower": lower, "upper": upper, "meaning": meaning})


@dataclass(frozen=True)
class Group:
    """A part of the plant: a frozen set of quantities, checked against their bounds when it is made.

    Raises
    ------
    ParameterError
        If a value is not finite, of the wrong kind or outside its bounds.
    """

    def __post_init__(self) -> None:
        for row in self.table():
            value = row.check(getattr(self, row.name), f"{self._part()}.")
            if isinstance(row.value, float) and isinstance(self._default(row.name), int):
                value = self._whole(row.name, value)
            object.__setattr__(self, row.name, value)

    @classmethod
    def table(cls) -> tuple[Parameter, ...]:
        """The quantities with their default values, in order."""
        rows = []
        for f in fields(cls):
            default = f.default if isinstance(f.default, tuple) else float(f.default)  # type: ignore[arg-type]
            m = f.metadata
            rows.append(Parameter(f.name, f.name, m["unit"], default, m["lower"], m["upper"], m["meaning"], SOURCE))
        return tuple(rows)

    @classmethod
    def _part(cls) -> str:
        """Name of this part in a plant file."""
        return cls.__name__.removeprefix("Plant").lower()

    @classmethod
    def _default(cls, name: str) -> object:
        return next(f.default for f in fields(cls) if f.name == name)

    @classmethod
    def _whole(cls, name: str, value: Any) -> int:
        if value != int(value):
            raise ParameterError(f"{cls._part()}.{name}: got {value:g}, expected a whole number")
        return int(value)
