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

"""Infers the channels of a file of other software from its column titles.

The result is reported and can be overridden.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

from ...channel_mapping import axis_of, quantity_of
from ...errors import RecordingError
from ...record import Notice
from .units import is_unit, plain, units_of

_UNIT = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$|[\s_,/:]\s*([^\s_,/:\[\]()]+)\s*$")
"""Unit at the end of a title, in brackets or after a separator."""
_AS_WRITTEN = re.compile(r"displacement_([^\W\d_]{2,})", re.IGNORECASE)
"""Title as this package writes it, where the word after the channel is a unit; a single letter may name an axis."""
_WORDS = {
    "time": r"time|zeit|\bt\b|\bx value\b|\bx-axis\b",
    "voltage": r"volt|drive|spannung|input|\bu\b|\bv\b|\bu_?in\b|\bv_?in\b",
    "displacement": r"disp|posi|sensor|stroke|weg\b|elong|output|\by\b|\bx\b",
}
"""Words in the title of a channel."""
_PERIODS = ("sampleperiod", "ts", "dt", "sampletime", "samplingperiod", "samplingtime", "deltat")
"""Names of a sample period."""
_RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "rate")
"""Names of a sample rate."""
_NOT_MEASURED = re.compile(r"command|target|desired|set_?point|reference|error|other", re.IGNORECASE)
"""Words in the titles of columns that were not measured."""


def unit_in(title: str, channel: str) -> str | None:
    """Unit at the end of a column title, if it is one of the channel.

    >>> unit_in("Weg [µm]", "displacement"), unit_in("t_ms", "time"), unit_in("Drive (um)", "voltage")
    ('um', 'ms', None)
    """
    match = _UNIT.search(title.strip().strip('#"'))
    unit = plain(match[1] or match[2] or "") if match else ""
    return unit if unit in units_of(channel) else None


def unit_of(title: str, channel: str, given: Collection[str]) -> str | None:
    """The unit of `unit_in`; a displacement whose title has another unit needs one that is `given`.

    Text in square brackets is a unit, a number is not, and in ``displacement_furlong`` the word after the channel is.
    A drive may be the command of a controller in any unit.

    Raises
    ------
    RecordingError
        If the title of a displacement ends in another unit, e.g. volts, and `given` lacks the channel.
    """
    words = title.strip().strip('#"').strip()
    match = _UNIT.search(words)
    ending = (match[2] if match else None) or ""
    unit = (match[1] if match else None) or (ending if is_unit(ending) else "")
    is_length = quantity_of(channel) == "displacement"
    if written := _AS_WRITTEN.fullmatch(words):
        unit = written[1]
    stated = written or is_unit(unit) or (words.endswith("]") and not unit.isdecimal())
    if is_length and channel not in given and unit and stated and unit_in(title, channel) is None:
        raise RecordingError(
            f"{channel}: got the unit '{unit}' in the title '{title.strip()}', expected one of "
            f"{', '.join(units_of(channel))}; give the SI value of one {plain(unit)} by `units`, e.g. {channel}=2e-6, "
            "or name another column by `columns`"
        )
    return unit_in(title, channel)


def named_column(title: str) -> tuple[str, str | None]:
    """Channel and unit that a column title names, e.g. ``displacement_um``, ``Voltage [V]``.

    >>> named_column("displacement_um"), named_column("Voltage [mV]"), named_column("phase")
    (('displacement', 'um'), ('voltage', 'mV'), ('phase', None))
    """
    name = title.strip().strip('#"').strip()
    for separator in ("[", "(", " ", "_"):
        channel, _, unit = name.rpartition(separator) if separator == "_" else name.partition(separator)
        channel = channel.strip().lower().replace(" ", "_")
        if plain(unit) in units_of(channel):
            return channel, plain(unit)
    return name.lower(), None


def inferred_columns(names: Sequence[str], taken: Iterable[int], wanted: Iterable[str]) -> dict[str, int]:
    """Position of the column of each wanted channel that has exactly one candidate.

    A candidate is found by its name, or else by the unit in its title, or else by its words. Two equal candidates leave
    the channel open.

    Parameters
    ----------
    names : sequence of str
        Titles of columns, or names of variables.
    taken : iterable of int
        Positions of columns that are used already.
    wanted : iterable of str
        Channels to look for, among time, voltage and displacement.

    Examples
    --------
    >>> titles = ["t_ms", "Piezo Voltage", "Target (um)", "Sensor (um)"]
    >>> inferred_columns(titles, (), ("time", "voltage", "displacement"))
    {'time': 0, 'voltage': 1, 'displacement': 3}
    """
    used = set(taken)
    found: dict[str, int] = {}
    for channel in wanted:
        free = [i for i in range(len(names)) if i not in used]
        if channel != "voltage":
            free = [i for i in free if not _NOT_MEASURED.search(names[i])]
        by_name = [i for i in free if named_column(names[i])[0] == channel]
        by_unit = [i for i in free if unit_in(names[i], channel)]
        by_word = [i for i in free if re.search(_WORDS[channel], names[i].replace("_", " "), re.IGNORECASE)]
        for candidates in (by_name, [i for i in by_unit if i in by_word], by_unit, by_word):
            if candidates:
                if len(candidates) == 1:
                    found[channel] = candidates[0]
                    used.add(candidates[0])
                break
    return found


def axis_columns(titles: Sequence[str], taken: Iterable[int]) -> dict[str, int]:
    """Position of the column of every further axis that is named by its number.

    Parameters
    ----------
    titles : sequence of str
        Titles of columns, or names of variables.
    taken : iterable of int
        Positions of columns that are used already.

    Examples
    --------
    >>> axis_columns(["voltage", "voltage_2", "Displacement 3 [um]", "monitor_voltage"], (0,))
    {'voltage_2': 1, 'displacement_3': 2}
    """
    used = set(taken)
    found: dict[str, int] = {}
    for at, title in enumerate(titles):
        name = named_column(title)[0].replace(" ", "_")
        if at not in used and axis_of(name):
            found.setdefault(name, at)
    return found


def inferred_period(names: Iterable[str]) -> tuple[str, bool] | None:
    """Name of the variable that holds the sample period [s], or with True the sample rate [Hz]; None where none does.

    The names are those of single numbers: a vector `ts` holds times.

    >>> inferred_period(["u", "y", "fs"]), inferred_period(["run.Ts"]), inferred_period(["u"])
    (('fs', True), ('run.Ts', False), None)
    """
    for name in names:
        word = name.rpartition(".")[2].lower().replace("_", "")
        if word in _PERIODS or word in _RATES:
            return name, word in _RATES
    return None


def period_of(name: str, value: float, is_rate: bool) -> float:
    """Sample period [s] from the value of a variable that `inferred_period` found.

    Raises
    ------
    RecordingError
        If it is a sample rate that is not positive.
    """
    if is_rate and not value > 0.0:
        raise RecordingError(f"{name}: got a sample rate of {value:g} Hz, expected more than 0; give `sample_period`")
    return 1.0 / value if is_rate else value


def require_different(places: Mapping[str, object]) -> None:
    """Refuse one column for two channels, e.g. the displacement as the voltage.

    Raises
    ------
    RecordingError
        If two channels have the same place.
    """
    taken: dict[object, str] = {}
    for channel, place in places.items():
        if place in taken:
            raise RecordingError(
                f"`columns`: got the same column for {taken[place]} and {channel}, expected different ones"
            )
        taken[place] = channel


def inference_notice(found: Mapping[str, str], units: Mapping[str, str | None]) -> tuple[Notice, ...]:
    """Notice about inferred columns: their channels, titles and units."""
    if not found:
        return ()
    message = ", ".join(f"{c} = '{title}'{f' in {units[c]}' if units.get(c) else ''}" for c, title in found.items())
    return (Notice("columns", f"columns taken by their titles: {message}; name others by `columns`"),)
