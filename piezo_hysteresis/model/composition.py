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

"""`Composition`: which effects a model consists of, and their numbers by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, TypeVar

from ..effects import Effect, HysteresisOperator
from ..errors import ModelError
from ..parameter import Parameter, Value
from .chain_order import in_chain_order

Kind = TypeVar("Kind", bound=Effect)


@dataclass(frozen=True, eq=False)
class Composition:
    """Effects in the order of the physics, found by name or by role. ``with_…`` returns a new one.

    Parameters
    ----------
    effects : iterable of Effect
        In any order; each at most once.

    Raises
    ------
    ModelError
        If an effect occurs twice, or a term has no host.

    Examples
    --------
    >>> from ..effects import Arx, BoucWen
    >>> effects = Composition((Arx(a=(-0.5,), b=(1.0,), delay=2.0), BoucWen()))
    >>> effects.without("bouc_wen").values()
    {'arx.a[0]': -0.5, 'arx.b[0]': 1.0, 'arx.delay': 2.0}
    """

    effects: tuple[Effect, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", in_chain_order(self.effects))

    def __repr__(self) -> str:
        return " → ".join(e.name for e in self.effects)

    def __getitem__(self, name: str) -> Effect:
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise ModelError(f"no effect '{name}' in the chain {', '.join(e.name for e in self.effects)}")

    def __contains__(self, name: object) -> bool:
        return any(e.name == name for e in self.effects)

    def effect(self, kind: type[Kind]) -> Kind:
        """The effect of a class, e.g. ``model.effect(Arx)``.

        Raises
        ------
        ModelError
            If the chain has none, or `kind` is no class.
        """
        if not isinstance(kind, type):
            raise ModelError(f"effect: got {kind!r}, expected a class such as Arx; model[name] finds an effect by name")
        for effect in self.effects:
            if isinstance(effect, kind):
                return effect
        raise ModelError(f"got no effect '{kind.name}' in {self!r}, expected one")

    @property
    def has_hysteresis(self) -> bool:
        """Whether an effect of the chain plays the role of the hysteresis."""
        return any(isinstance(e, HysteresisOperator) for e in self.effects)

    @property
    def hysteresis(self) -> HysteresisOperator:
        """The effect that plays the role of the hysteresis, whichever operator it is.

        Raises
        ------
        ModelError
            If the chain has none.
        """
        for effect in self.effects:
            if isinstance(effect, HysteresisOperator):
                return effect
        raise ModelError(f"got no hysteresis in {self!r}, expected one, e.g. BoucWen()")

    def with_hysteresis(self, operator: HysteresisOperator) -> Self:
        """With `operator` in the role of the hysteresis, instead of the one that has it."""
        kept = tuple(e for e in self.effects if not isinstance(e, HysteresisOperator))
        return replace(self, effects=(*kept, operator))

    def with_effect(self, effect: Effect) -> Self:
        """With `effect` in its place in the chain, instead of one of the same name."""
        return replace(self, effects=(*(e for e in self.effects if e.name != effect.name), effect))

    def without(self, name: str) -> Self:
        """Without the effect `name`."""
        return replace(self, effects=tuple(e for e in self.effects if e.name != name))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """With other numbers, named ``"creep.gamma"`` or ``"arx.a[0]"``.

        Raises
        ------
        ModelError
            If no effect has one of the names.
        ParameterError
            On a value outside its bounds.
        """
        changed: dict[str, dict[str, Value]] = {}
        for name, number in values.items():
            parameter, (owner, _, rest) = self.row(name).name, name.partition(".")
            inside = changed.setdefault(owner, self[owner].values)
            if rest == parameter:
                inside[parameter] = number
            else:
                elements = list(inside[parameter])  # type: ignore[arg-type]
                elements[int(rest[len(parameter) + 1 : -1])] = number
                inside[parameter] = tuple(elements)
        kept = (e.with_values(**changed[e.name]) if e.name in changed else e for e in self.effects)
        return replace(self, effects=tuple(kept))

    def values(self) -> dict[str, float]:
        """All numbers by name, ``"bouc_wen.A"``, ``"arx.a[0]"``."""
        return {f"{e.name}.{n}": v for e in self.effects for n, v in zip(e.free_names(), e.free_values(), strict=True)}

    def row(self, name: str) -> Parameter:
        """The table row of a number, or of all numbers of an array parameter.

        Raises
        ------
        ModelError
            If no effect has it.
        """
        owner, _, rest = name.partition(".")
        effect = self[owner]
        for row in effect.parameters:
            if rest == row.name or (rest.partition("[")[0] == row.name and rest in effect.free_names()):
                return row
        raise ModelError(f"no number '{name}', expected one of {', '.join(effect.free_names())} of '{owner}'")
