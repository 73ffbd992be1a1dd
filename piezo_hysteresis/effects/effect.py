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

"""`Effect`: the contract of the catalogue. One physical effect, its equation, its parameters, its place in the chain.

Three moments, three names: *parameters* (physical, with units) become *coefficients* for one sample period when
`Effect.block` is called, and the block runs a *kernel* per sample.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Self

import numpy as np

from ..blocks.block import Block
from ..errors import ModelError, ParameterError
from ..parameter import Parameter, Value
from .excitation_need import ExcitationNeed
from .extent import Extent
from .invertibility import Invertibility


class ChainPosition(IntEnum):
    """Position in the chain u → v → w → x → y at which an effect acts; the chain is sorted by it."""

    DRIVE = 0
    """Between the drive voltage and the actuator: volts in, volts out."""
    HYSTERESIS = 1
    """From the normalised actuator input v to the hysteresis output w; members add up."""
    MATERIAL = 2
    """On w, before the mechanics: creep."""
    DYNAMICS = 3
    """From w to the normalised position of the stage."""
    SENSOR = 4
    """On the normalised position."""
    ENVIRONMENT = 5
    """Added to the displacement [m]."""


@dataclass(frozen=True, slots=True)
class Discretisation:
    """Sample period and scales from which an effect computes its coefficients.

    Parameters
    ----------
    sample_period : float
        Period of the samples [s].
    model_period : float
        Period at which discrete dynamics were identified [s]; smaller than `sample_period` in slow phases.
    voltage_scale : float
        v = u / voltage_scale [V].
    displacement_scale : float
        Normalised output times this is displacement [m].
    """

    sample_period: float
    model_period: float
    voltage_scale: float = 1.0
    displacement_scale: float = 1.0

    @property
    def is_slow(self) -> bool:
        """True if discrete dynamics act as dc gain plus group delay."""
        return self.sample_period > 1.001 * self.model_period


class Effect(ABC):
    """One physical effect with its parameter values; frozen, ``with_values`` returns a new one.

    Parameters
    ----------
    **values : float or sequence of float
        Parameter values by name; the others take the defaults of the table.

    Raises
    ------
    ParameterError
        If a name is unknown, or a value is outside its bounds.
    """

    name: ClassVar[str]
    """Identifier in model files, in ROS parameters and in the output of `piezo`."""
    family: ClassVar[str]
    """Name of the group of related effects to which this one belongs."""
    place: ClassVar[ChainPosition]
    """Position in the chain."""
    entry: ClassVar[str] = ""
    """Effect of the catalogue of which this is another law (`creep_exponential` of ``creep``); empty if it is none."""
    host: ClassVar[str | None] = None
    """Effect whose kernel contains this one as a term (terms of the Bouc-Wen loop, softening of the ARX mode)."""
    channel: ClassVar[str | None] = None
    """Extra channel of the record that is needed: ``other_displacement`` or ``temperature``."""
    twin: ClassVar[str | None] = None
    """Effect that slow drive cannot distinguish from this one."""
    excitation_need: ClassVar[ExcitationNeed | None] = None
    """Kind of drive that is needed to show the effect; None if nearly every record can show it."""
    loop_names: ClassVar[tuple[str, ...]] = ()
    """Parameters to which the height of the hysteresis loop is proportional."""
    invertibility: ClassVar[Invertibility]
    """Whether `piezo_hysteresis.compensation` can invert the effect."""
    equation: ClassVar[str]
    """The law as text; x is the input of the effect and y its output, if the effect has no other symbols for them."""
    signature: ClassVar[str]
    """How the effect shows in measured data."""
    source: ClassVar[str]
    """Publication or experience from which the law or its size is taken."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Table of the parameters with units, bounds and default values."""

    def __init__(self, **values: Value) -> None:
        table = {p.name: p for p in self.parameters}
        for name in values:
            if name not in table:
                raise ParameterError(f"{self.name}: got unknown parameter '{name}', expected one of {', '.join(table)}")
        self._values = {n: p.check(values.get(n, p.value), f"{self.name}.") for n, p in table.items()}
        self.check()

    def check(self) -> None:
        """Refuse combinations of values that are not valid, although each value is inside its bounds."""

    def __getitem__(self, name: str) -> float:
        value = self._values[name]
        if isinstance(value, tuple):
            raise ParameterError(
                f"{self.name}.{name}: got an array parameter, expected a scalar one; use array('{name}')"
            )
        return value

    def array(self, name: str) -> np.ndarray:
        """The values of an array parameter, shape (k,); shape () for a scalar one."""
        return np.array(self._values[name], dtype=np.float64)

    @property
    def values(self) -> dict[str, Value]:
        """Parameter values by name."""
        return dict(self._values)

    @property
    def is_off(self) -> bool:
        """True if every parameter that can switch the effect off has its off value."""
        rows = [p for p in self.parameters if p.off is not None]
        return bool(rows) and all(np.all(np.asarray(self._values[p.name]) == p.off) for p in rows)

    def with_values(self, **values: Value) -> Self:
        """The same effect with some values replaced."""
        return type(self)(**{**self._values, **values})

    @classmethod
    def is_twin_of(cls, other: Effect | type[Effect]) -> bool:
        """Whether slow drive cannot distinguish the two effects; one of the two names the other one as its twin."""
        return cls.twin == other.name or other.twin == cls.name

    def off(self) -> Self:
        """The same effect, exactly switched off."""
        switched: dict[str, Value] = {
            p.name: (p.off,) * len(v) if isinstance(v := self._values[p.name], tuple) else p.off
            for p in self.parameters
            if p.off is not None
        }
        return self.with_values(**switched)

    def free_names(self) -> Iterator[str]:
        """Names of all scalar numbers: ``"gamma"``, or ``"a[0]"`` for elements of an array parameter."""
        for row in self.parameters:
            value = self._values[row.name]
            if isinstance(value, tuple):
                yield from (f"{row.name}[{i}]" for i in range(len(value)))
            else:
                yield row.name

    def loop_numbers(self) -> tuple[str, ...]:
        """Names of the single numbers of `loop_names`."""
        return tuple(n for n in self.free_names() if n.partition("[")[0] in self.loop_names)

    def free_values(self) -> Iterator[float]:
        """All scalar numbers, in the order of `free_names`."""
        for value in self._values.values():
            if isinstance(value, tuple):
                yield from map(float, value)
            else:
                yield float(value)

    @classmethod
    def public_name(cls) -> str:
        """Identifier of the effect in the catalogue."""
        return cls.entry or cls.name

    @classmethod
    def is_predicted_live(cls) -> bool:
        """False for an effect with parameters that are different in every recording and cannot be known in advance."""
        return not any(row.per_record for row in cls.parameters)

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Effects from which a search for the effect starts.

        The effect is switched off if the sensitivity at its off value is useful. It has a finite size if the
        sensitivity is zero there (a limit that is not reached). There are several sizes if the cost has several minima.

        Parameters
        ----------
        extent : Extent
            Ranges that the experiment covers.

        Returns
        -------
        tuple of Effect
        """
        return (cls(),)

    def refined(self) -> Effect | None:
        """The same effect with about the same output and more parameters to fit; None if there is no such form."""
        return None

    @abstractmethod
    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        """Coefficients and kernels for one sample period.

        Parameters
        ----------
        setting : Discretisation
            Sample periods and scales.
        terms : tuple of Effect
            Effects that are terms of this one, if it is a host.
        """

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other._values == self._values

    def __hash__(self) -> int:
        return hash((self.name, tuple(self._values.items())))

    def __repr__(self) -> str:
        inside = ", ".join(f"{n}={v!r}" for n, v in self._values.items())
        return f"{type(self).__name__}({inside})"


class Term(Effect):
    """An effect inside the recursion of another one, computed in the block of its `host`."""

    host: ClassVar[str]

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        raise ModelError(f"'{self.name}' has no separate block: it is a term of '{self.host}'; pass it to that block")
