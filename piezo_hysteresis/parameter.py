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

"""`Parameter`: name, symbol, unit, value, bounds and meaning of one number of a model.

The table is the single source for Python, model files, ROS parameter descriptors and the docs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .errors import ParameterError

Value = float | tuple[float, ...]


def parts_of(text: str) -> list[str]:
    """Parts of a text with commas between them, without blanks around them and without empty ones.

    >>> parts_of("/stage_x, /stage_y,")
    ['/stage_x', '/stage_y']
    """
    return [part.strip() for part in text.split(",") if part.strip()]


def slew_text(rate: float, digits: int = 6) -> str:
    """A rate of change of a voltage as text, never with an exponent of ten.

    >>> slew_text(30000.0, 4), slew_text(0.12345, 4), slew_text(1.25e6)
    ('30000 V/s', '0.1235 V/s', '1250000 V/s')
    """
    return f"{float(f'{rate:.{digits}g}'):.15g} V/s"


def number_text(value: float, half: float | None = None) -> str:
    """A number with four digits, or with more if half of its interval shows that it is known better.

    >>> number_text(236.6539, 0.025), number_text(236.6539, 3.0), number_text(236.6539)
    ('236.654', '236.7', '236.7')
    """
    digits = 4
    if value and half and math.isfinite(value) and math.isfinite(half):
        digits = max(digits, 2 + math.floor(math.log10(abs(value))) - math.floor(math.log10(half)))
    return f"{value:.{min(digits, 15)}g}"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A named physical quantity with unit, value, bounds, meaning and source.

    Parameters
    ----------
    name : str
        Identifier in Python, YAML and ROS, e.g. ``"gamma"``.
    symbol : str
        Symbol of docs/nomenclature, e.g. ``"γ"``.
    unit : str
        SI unit; ``"1"`` if dimensionless.
    value : float or tuple of float
        Default value; a tuple is an array parameter of any length.
    lower, upper : float
        Inclusive bounds of every element.
    meaning : str
        Meaning in one line.
    source : str
        Paper and equation.
    off : float, optional
        Value at which the effect is exactly absent; None if the parameter alone does not switch it off.
    scale : float
        Typical size, for the conditioning of fits and for finite differences.
    per_record : bool
        True for a quantity that is free in every record (the phase of mains hum).
    fixed : bool
        True for a quantity that is chosen and never fitted (the time range of a creep bank); it has no sensitivity.
    powers : (int, int)
        Powers of the scales U [V] and Y [m] of a model by which its value is multiplied to be a physical quantity.

    Raises
    ------
    ParameterError
        If the bounds are crossed or the default lies outside them.
    """

    name: str
    symbol: str
    unit: str
    value: Value
    lower: float
    upper: float
    meaning: str
    source: str
    off: float | None = None
    scale: float = 1.0
    per_record: bool = False
    fixed: bool = False
    powers: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        if not self.lower <= self.upper:
            raise ParameterError(f"{self.name}: bounds [{self.lower}, {self.upper}] are crossed")
        self.check(self.value)

    @property
    def is_array(self) -> bool:
        """True if the value is a tuple."""
        return isinstance(self.value, tuple)

    @property
    def physical_unit(self) -> str:
        """Unit of the physical quantity.

        >>> Parameter("p1", "p1", "1", 0.0, -1.0, 1.0, "cubic term", "paper, Eq. (3)", powers=(-3, 1)).physical_unit
        'm/V^3'
        """
        if self.powers == (0, 0):
            return self.unit
        above, below = (
            "·".join(
                unit if abs(power) == 1 else f"{unit}^{abs(power)}"
                for unit, power in zip(("V", "m"), self.powers, strict=True)
                if sign * power > 0
            )
            for sign in (1, -1)
        )
        return f"{above or '1'}/{below}" if below else above

    def check(self, value: object, prefix: str = "") -> Value:
        """Return `value` as float or tuple of floats inside the bounds.

        Parameters
        ----------
        value : object
            Number, or sequence of numbers for an array parameter.
        prefix : str
            Put before the name in messages, e.g. ``"bouc_wen."``.

        Raises
        ------
        ParameterError
            If the type is wrong, or a number is not finite or outside the bounds.
        """
        name = prefix + self.name
        if self.is_array:
            try:
                numbers: enumerate[object] = enumerate(value)  # type: ignore[arg-type]
                return tuple(self._scalar(v, f"{name}[{i}]") for i, v in numbers)
            except TypeError:
                raise ParameterError(f"{name}: got {value!r}, expected a sequence of numbers [{self.unit}]") from None
        return self._scalar(value, name)

    def _scalar(self, value: object, name: str) -> float:
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise ParameterError(f"{name}: got {value!r}, expected a number [{self.unit}]") from None
        if not math.isfinite(number) or not self.lower <= number <= self.upper:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ParameterError(f"{name}: got {number:g}{unit}, expected {self.lower:g} to {self.upper:g}{unit}")
        return number


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting that is not a physical quantity: a word, a path, a switch, a count.

    Parameters
    ----------
    name : str
        Name of the setting.
    value : str, bool or int
        Default.
    meaning : str
        One line for its description.
    choices : tuple of str
        The accepted words; empty if any word is accepted.
    lower, upper : int
        Inclusive bounds of a number.

    Raises
    ------
    ParameterError
        If the default is not valid.
    """

    name: str
    value: str | bool | int
    meaning: str
    choices: tuple[str, ...] = ()
    lower: int = -(2**63)
    upper: int = 2**63 - 1

    def __post_init__(self) -> None:
        self.check(self.value)

    @property
    def is_number(self) -> bool:
        """True for a count; False for a switch."""
        return type(self.value) is int

    def check(self, value: object, prefix: str = "") -> str | bool | int:
        """Return `value` if it is of the type of the default, one of the choices, and inside the bounds.

        Raises
        ------
        ParameterError
            Otherwise.
        """
        if type(value) is not type(self.value):
            raise ParameterError(f"{prefix}{self.name}: got {value!r}, expected a {type(self.value).__name__}")
        if self.choices and value not in self.choices:
            raise ParameterError(f"{prefix}{self.name}: got {value!r}, expected one of {', '.join(self.choices)}")
        if isinstance(value, int) and not self.lower <= value <= self.upper:
            raise ParameterError(f"{prefix}{self.name}: got {value}, expected {self.lower} to {self.upper}")
        return value


Row = Parameter | Setting
