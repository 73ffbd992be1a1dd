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

"""The numbers of a chain by name, ``"creep.gamma"`` or ``"arx.a[0]"``."""

from __future__ import annotations

import re
from collections.abc import Mapping

from ..effects import Effect
from ..errors import ModelError
from ..parameter import Value


def numbers_of(effects: tuple[Effect, ...]) -> dict[str, float]:
    """All numbers of the effects, in chain order.

    Examples
    --------
    >>> from ..effects import Arx
    >>> numbers_of((Arx(a=(-0.5,), b=(1.0,), delay=2.0),))
    {'arx.a[0]': -0.5, 'arx.b[0]': 1.0, 'arx.delay': 2.0}
    """
    return {f"{e.name}.{n}": v for e in effects for n, v in zip(e.free_names(), e.free_values(), strict=True)}


def with_numbers(effects: tuple[Effect, ...], values: Mapping[str, float]) -> tuple[Effect, ...]:
    """The effects with some numbers changed.

    Raises
    ------
    ModelError
        If no effect has one of the names.
    ParameterError
        On a value outside its bounds.
    """
    by_name = {e.name: e for e in effects}
    changed: dict[str, dict[str, Value]] = {}
    for name, number in values.items():
        owner, _, rest = name.partition(".")
        if owner not in by_name:
            raise ModelError(f"no effect '{owner}' in the chain {', '.join(by_name)}")
        inside = changed.setdefault(owner, by_name[owner].values)
        match = re.fullmatch(r"(\w+)\[(\d+)\]", rest)
        if match:
            row = list(inside[match[1]])  # type: ignore[arg-type]
            row[int(match[2])] = number
            inside[match[1]] = tuple(row)
        else:
            inside[rest] = number
    return tuple(e.with_values(**changed[e.name]) if e.name in changed else e for e in effects)
