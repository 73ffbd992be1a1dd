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

"""Writes a `CForm` as C text: its structures, its constants and its two functions."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

import numpy as np

from ..c_form import CForm, Number

INDENT = " " * 4
"""Indentation of one level of C code."""
ROW = 4
"""Number of values in one line of an array."""


def number(value: float) -> str:
    """A double as C text that is read back bit for bit.

    >>> number(0.1), number(-2.0), number(math.inf)
    ('0.1', '-2.0', 'INFINITY')
    """
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def array(values: np.ndarray) -> str:
    """Initialiser of an array (n,) as C text, with `ROW` numbers in a line."""
    rows = [values[k : k + ROW] for k in range(0, values.size, ROW)]
    lines = ",\n".join(2 * INDENT + ", ".join(number(v) for v in row) for row in rows)
    return f"{{\n{lines}\n{INDENT}}}" if len(rows) > 1 else "{ " + lines.strip() + " }"


def constants(numbers: Mapping[str, Number], body: str) -> Iterator[str]:
    """C declarations of those constants that a function body uses."""
    for name, value in numbers.items():
        if not re.search(rf"(?<![\w.>]){name}\b", body):
            continue
        if isinstance(value, np.ndarray):
            yield f"static const double {name}[{value.size}] = {array(value)};"
        elif isinstance(value, int):
            yield f"enum {{ {name} = {value} }};"
        else:
            yield f"const double {name} = {number(value)};"


def structures(prefix: str, name: str, form: CForm) -> Iterator[str]:
    """C types of the state of a form and of its parts, innermost first; none for a form without state."""
    if not form.has_state:
        return
    for part, inner in form.parts.items():
        yield from structures(prefix, f"{name}_{part}", inner)
    members = [*form.state, *(f"{prefix}_{name}_{p} {p}" for p, inner in form.parts.items() if inner.has_state)]
    lines = "".join(f"{INDENT}{member};\n" for member in members)
    yield f"typedef struct {{\n{lines}}} {prefix}_{name};\n"


def functions(prefix: str, name: str, form: CForm, *, always_rest: bool = True) -> Iterator[str]:
    """The functions ``PREFIX_NAME_rest`` and ``PREFIX_NAME_step`` of a form, after those of its parts.

    Without `always_rest` a form without state has no ``rest``.
    """
    for part, inner in form.parts.items():
        yield from functions(prefix, f"{name}_{part}", inner, always_rest=always_rest)
    state = f"{prefix}_{name} *s, " if form.has_state else ""
    channel = f", double {form.channel}" if form.channel else ""
    for function, body in (("rest", form.rest or form.step), ("step", form.step)):
        if function == "rest" and not (always_rest or form.has_state):
            continue
        inputs = "double x" + (channel if function == "step" else "")
        text = body.replace("ME_", f"{prefix}_{name}_").rstrip()
        lines = [*constants(form.numbers, body), *text.splitlines()]
        inside = "".join(f"{INDENT}{line}\n" if line else "\n" for line in lines)
        yield f"static double {prefix}_{name}_{function}({state}{inputs})\n{{\n{inside}}}\n"


def library(forms: Mapping[str, CForm]) -> tuple[str, ...]:
    """C library functions that the forms and their parts need, each once."""
    found: dict[str, None] = {}
    for form in forms.values():
        found |= dict.fromkeys((*library(form.parts), *form.library))
    return tuple(found)
