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

"""`sentence_of`: a changed parameter in words, with its size and interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..parameter import number_text
from .change_kinds import KINDS, LEAVES, ParameterChange

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
"""Units of time."""

UNSEEN = (
    " The stage moves within one sample, at a time that the samples do not show: the interval includes this, but not a "
    "mode above half the sampling rate that has moved."
)
"""Added to a lag that the samples show only in part."""


def sentence_of(change: ParameterChange) -> str:
    """The change in a few sentences, with its size and interval."""
    kind = change.kind
    numbers = change.size, *change.time_constants
    size = _with_interval([abs(n) for n in numbers] if change.key == "delay" else numbers, kind.unit)
    if kind.is_filter:
        size += f", cut-off frequency {0.5 / np.pi * kind.cut_off / change.size:.4g} Hz"
    words = [kind.words.format(how="later" if change.size > 0.0 else "earlier", size=size)]
    words += [KINDS[key].words.format(size=_with_interval(also, KINDS[key].unit)) for key, also in change.also.items()]
    late = f" It delays slow signals by {_with_interval(change.lag, 's')}." if "lag" in change.parameters else ""
    what = ", ".join(f"{k.name} ({k.family})" for k in (kind, *(KINDS[key] for key in change.also)))
    names = change.others
    alike = f" It cannot be distinguished from {' and '.join(names)} in these records." if names else ""
    left = "" if change.after < LEAVES else " The remaining error is above the known error, so the form is not certain."
    said = f"{late}{alike}{left}{UNSEEN if change.unseen else ''}"
    return f"The stage is the same, but {' and '.join(words)}: {what}.{said}"


def _with_interval(numbers: Sequence[float], unit: str) -> str:
    """A value and its 95 % interval in a readable unit."""
    factor = 1.0
    if unit == "s":
        factor, unit = next((f, u) for f, u in UNITS if abs(numbers[0]) >= f or f == UNITS[-1][0])
    elif unit == "1":
        factor, unit = 0.01, "%"
    elif unit == "m":
        factor, unit = 1e-9, "nm"
    value, *ends = (n / factor for n in numbers)
    low, high = sorted(ends)
    shown, begin, end = (number_text(number, 0.5 * (high - low)) for number in (value, low, high))
    return f"{shown} {unit} (95 %: {begin} to {end} {unit})"
