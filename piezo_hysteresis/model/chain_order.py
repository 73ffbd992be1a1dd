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

"""The order of a chain: the order of the physics. Every effect states its place."""

from __future__ import annotations

from collections.abc import Iterable

from ..effects import CHAIN, Effect
from ..errors import ModelError


def in_chain_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """The effects in the order in which they act.

    Raises
    ------
    ModelError
        If an effect occurs twice, a term has no host, or something is not an effect.
    """
    effects = tuple(effects)
    for effect in effects:
        if not isinstance(effect, Effect):
            raise ModelError(f"effects: got {effect!r}, expected effects, e.g. BoucWen()")
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
