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

"""`CForm`: a block as C code, declared next to the equivalent kernel.

The code is plain C99. A block becomes two functions, ``rest`` and ``step``, and a state that is kept between their
calls. `piezo_hysteresis.export` writes the rest of the program.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Number = int | float | NDArray[np.float64]
"""Constant of a C form: a count, a number, or an array of numbers."""


@dataclass(frozen=True, eq=False, slots=True)
class CForm:
    """Two C functions and the state between their calls.

    ``double rest(state *s, double x)`` sets the state of a stage settled at the input x and returns the output there;
    ``double step(state *s, double x)`` takes the next input. A form without state has no argument s. ``ME_`` in a body
    or a member is replaced by the name of the block in the program.

    Parameters
    ----------
    step : str
        Body of ``step``.
    rest : str, optional
        Body of ``rest``; default: that of ``step``, for forms without state.
    numbers : mapping of str to int, float or ndarray
        Constants by their names in the bodies. An integer becomes an enumeration constant.
    state : tuple of str
        Declarations of the members of the state.
    library : tuple of str
        Functions that the bodies call, each after those that it calls. Every text is written once, even if several
        forms use it.
    parts : mapping of str to CForm
        Inner blocks, called by the expressions of `call`.
    channel : str
        Further measured input of ``step``, by its name in the record; empty for none.
    """

    step: str
    rest: str = ""
    numbers: Mapping[str, Number] = field(default_factory=dict)
    state: tuple[str, ...] = ()
    library: tuple[str, ...] = ()
    parts: Mapping[str, CForm] = field(default_factory=dict)
    channel: str = ""

    @property
    def has_state(self) -> bool:
        """Whether the functions have an argument s."""
        return bool(self.state) or any(part.has_state for part in self.parts.values())

    def call(self, function: str, name: str, x: str) -> str:
        """C expression, inside a form that has this one as part `name`, that calls its ``step`` or ``rest``."""
        return f"ME_{name}_{function}(&s->{name}, {x})" if self.has_state else f"ME_{name}_{function}({x})"


HISTORY = """\
/* Puts x before the `size` samples of a history and returns it, newest first. Every sample is kept twice, so that the
   history is always in one piece and nothing has to be moved. */
static const double *remember(double *history, int size, int *newest, double x)
{
    *newest = (*newest > 0 ? *newest : size) - 1;
    history[*newest] = x;
    history[*newest + size] = x;
    return history + *newest;
}
"""
"""C function of delays and filters."""
