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

"""Units of foreign recordings and their SI values."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...channel_mapping import quantity_of
from ...errors import RecordingError

_METRE: Mapping[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12}
"""Units of length over the metre."""
_VOLT: Mapping[str, float] = {"V": 1.0, "kV": 1e3, "mV": 1e-3, "uV": 1e-6}
"""Units of voltage over the volt."""
_SECOND: Mapping[str, float] = {"s": 1.0, "min": 60.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time over the second."""
_KELVIN: Mapping[str, float] = {"K": 1.0, "mK": 1e-3}
"""Units of temperature over the kelvin."""

_UNITS: Mapping[str, Mapping[str, float]] = {
    "time": _SECOND,
    "sample_period": _SECOND,
    "initial_voltage": _VOLT,
    "voltage": _VOLT,
    "displacement": _METRE,
    "temperature": _KELVIN,
}
"""Quantity, or label, to the units it may have, each with its SI value."""


def units_of(channel: str) -> Mapping[str, float]:
    """Units that a channel or label may have, each with its SI value; empty if it has none.

    >>> list(units_of("temperature_of_base")), dict(units_of("phase"))
    (['K', 'mK'], {})
    """
    return _UNITS.get(quantity_of(channel) or channel, {})


_WORDS: Mapping[str, str] = {
    "second": "s", "seconds": "s", "sec": "s", "msec": "ms", "usec": "us", "volt": "V", "volts": "V", "millivolt": "mV",
    "metre": "m", "meter": "m", "micron": "um", "microns": "um", "micrometer": "um", "micrometre": "um",
    "nanometer": "nm", "nanometre": "nm", "kelvin": "K",
}  # fmt: skip
"""Units in words, as oscilloscopes and interferometers write them, to their symbols."""


def plain(unit: str) -> str:
    """A unit as it is typed on a keyboard: ``"[µm]"`` becomes ``"um"``, ``"Volt"`` becomes ``"V"``."""
    symbol = unit.strip(" \t[]()").replace("µ", "u").replace("μ", "u")
    return _WORDS.get(symbol.lower(), symbol)


def is_unit(word: str) -> bool:
    """True for a unit of any channel.

    >>> is_unit("[µm]"), is_unit("Position")
    (True, False)
    """
    return any(plain(word) in known for known in _UNITS.values())


REVERSED = "-"
"""A minus before a unit, or alone for the unit in the file: the sensor is reversed."""


def si_factor(channel: str, unit: str | float) -> float:
    """SI value of one `unit` of a channel.

    Parameters
    ----------
    channel : str
        Channel name, e.g. ``"displacement"``.
    unit : str or float
        Unit word, with a minus for a reversed sensor, or a number: the SI value of one count (a sensor of 2 µm/V
        recorded in V has 2e-6). A minus alone is that of the SI unit.

    Raises
    ------
    RecordingError
        If the channel has no such unit or the number is not finite or zero.

    Examples
    --------
    >>> si_factor("displacement", "um"), si_factor("displacement", 2e-6), si_factor("displacement", "-um")
    (1e-06, 2e-06, -1e-06)
    """
    known = units_of(channel)
    if isinstance(unit, str):
        if unit == REVERSED:
            return -1.0
        sign, word = (-1.0, plain(unit[1:])) if unit.startswith(REVERSED) else (1.0, plain(unit))
        if word in known:
            return sign * known[word]
        try:
            unit = float(unit)
        except ValueError:
            raise RecordingError(
                f"`units`: got '{unit}' for {channel}, expected one of {', '.join(known)} or the SI value of one count"
            ) from None
    if not math.isfinite(unit) or unit == 0.0:
        raise RecordingError(f"`units`: got {unit} for {channel}, expected a finite number other than zero")
    return float(unit)
