"""The order of a chain: that of physics, which every effect states by its place."""

from __future__ import annotations

from collections.abc import Iterable

from ..effects import CHAIN, Effect
from ..errors import ModelError


def in_chain_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """The effects in the order in which they act.

    Raises
    ------
    ModelError
        On a doubled effect, or a term without its host.
    """
    ordered = tuple(sorted(effects, key=_place))
    names = [e.name for e in ordered]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"effect '{name}' is in the chain twice; expected each at most once")
    for effect in ordered:
        if effect.host is not None and effect.host not in names:
            raise ModelError(f"effect '{effect.name}' needs '{effect.host}' in the chain, got {', '.join(names)}")
    return ordered


def _place(effect: Effect) -> tuple[int, int]:
    return int(effect.place), CHAIN.index(type(effect)) if type(effect) in CHAIN else len(CHAIN)
