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

"""Lengths and times as text, with a suitable unit, and what the pages and the terminal both say of an error."""

from __future__ import annotations

from ..identification.fit.form_uncertainty import ADEQUACY

USELESS, POOR = 30.0, 3.0
"""Free-run errors [% of range] from which a model describes nothing, and from which it is poor."""
FLOOR = f"The noise floor of a phase is its noise or {100 * ADEQUACY:g} % of the range, whichever is larger."
"""What the floor beside an error is."""


def nanometre(metres: float) -> str:
    """A length as text: in nm below a micrometre, otherwise in µm.

    >>> nanometre(1.234e-8), nanometre(2.5e-6)
    ('12.3 nm', '2.5 µm')
    """
    return f"{metres * 1e9:.3g} nm" if abs(metres) < 1e-6 else f"{metres * 1e6:.3g} µm"


def duration(seconds: float) -> str:
    """A time as text.

    >>> duration(2e-5), duration(0.25), duration(175.0)
    ('20 µs', '250 ms', '175 s')
    """
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e9:.4g} ns"


def describes(percent: float) -> bool:
    """Whether a model with this free-run error [% of range] describes the stage at all."""
    return percent < USELESS


def error_sentence(percent: float) -> str:
    """A free-run error in words.

    >>> error_sentence(126.0)
    'The model does not describe this stage: its error is 126 % of the range. Check columns, units and sample period.'
    """
    if not describes(percent):
        return (
            f"The model does not describe this stage: its error is {percent:.3g} % of the range. Check columns, units "
            "and sample period."
        )
    if percent > POOR:
        return f"The model describes this stage poorly: its error is {percent:.3g} % of the range; see piezo diagnose."
    return f"The model describes this stage; its error in free run is {percent:.3g} % of the range."
