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

"""`Dialect`: the notation of the numbers in a text file, detected from its first lines."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from .units import is_unit, plain

SNIFFED_BYTES = 1 << 18
"""Number of bytes at the beginning of a file from which its dialect is detected."""
COMMENT = ("#", "%")
"""Beginnings of comment lines."""
_STAMP = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d+)?Z?")
"""A date with time of day."""
_CLOCK = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
"""A time of day, as instruments write it beside a column of dates."""
_MIDNIGHT = 2.0**27
"""Time from which times of day count [s]: large as that of a date, so that a table begins at its first row."""
_YEAR_2000 = np.datetime64("2000-01-01", "ns")
"""Date from which times are counted."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """Notation of the numbers in a text file.

    Parameters
    ----------
    delimiter : str or None
        Character between columns; None for any white space.
    decimal_comma : bool
        True where numbers are written 1,5.
    skipped : int
        Lines before the first row of numbers.
    header : tuple of str
        Column names from the line above it; empty where there are none.
    width : int
        Number of columns.
    """

    delimiter: str | None
    decimal_comma: bool
    skipped: int
    header: tuple[str, ...]
    width: int

    @classmethod
    def sniff(cls, path: Path) -> Dialect:
        """Find the dialect from the first lines of a file.

        Raises
        ------
        RecordingError
            If no line is followed by rows of two or more columns with numbers.
        """
        with path.open("rb") as file:
            block = file.read(SNIFFED_BYTES)
            if block.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
                raise RecordingError("got text in UTF-16, expected UTF-8 or Latin-1; save it again as UTF-8")
            lines = decoded(block).splitlines()
            if file.read(1) or not block.endswith((b"\n", b"\r")):  # the last line may be incomplete
                return cls._best(lines[:-1]) or cls._of(lines)
        return cls._of(lines)

    @classmethod
    def _of(cls, lines: Sequence[str]) -> Dialect:
        if (found := cls._best(lines)) is None:
            raise RecordingError("got no rows of numbers in two or more columns")
        return found

    @classmethod
    def _best(cls, lines: Sequence[str]) -> Dialect | None:
        best: tuple[float, int, Dialect] | None = None
        for delimiter, comma in (
            (",", False),
            (";", False),
            (";", True),
            ("\t", False),
            ("\t", True),
            (None, False),
            (None, True),
        ):
            found = cls._with(lines, delimiter, comma)
            if found is not None and (best is None or found[:2] > best[:2]):
                best = found
        return best and best[2]

    @classmethod
    def _with(cls, lines: Sequence[str], delimiter: str | None, comma: bool) -> tuple[float, int, Dialect] | None:
        rows = [[] if line.lstrip().startswith(COMMENT) else cells_of(line, delimiter) for line in lines]
        body = [row for row in rows if row][-40:]
        width = len(body[-1]) if body else 0
        names = {at for row in rows if len(row) == width for at, cell in enumerate(row) if cell.lower() == "phase"}
        of_numbers = [at for at in range(width) if at not in names and number_in(body[-1][at], comma) is not None]
        like = (i for i, row in enumerate(rows) if len(row) == width and _all(row, of_numbers, comma))
        first = next((i for i in like if _has_numbers(rows[i], comma)), None)
        if width < 2 or first is None:
            return None
        filled = [[cell for cell in row if cell] for row in body if len(row) == width]
        numeric = [np.mean([number_in(cell, comma) is not None for cell in row]) for row in filled if row]
        above = [line for line in lines[:first] if line.strip(" \t,;#%")][-2:]
        titles = (cells_of(line.lstrip(" #%"), delimiter) for line in reversed(above))
        header = _titles(*(tuple(cells) if len(cells) == width else () for cells in titles))
        return float(np.sum(numeric)) / len(body), width, cls(delimiter, comma, first, header, width)


def decoded(block: bytes) -> str:
    """Text in UTF-8, or else in the Latin-1 of older instruments."""
    try:
        return block.decode("utf-8-sig")
    except UnicodeDecodeError:
        return block.decode("latin-1")


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Cells of one line."""
    if delimiter is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)] if line.strip() else []
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def number_in(cell: str, comma: bool) -> float | None:
    """Number or time stamp in a cell; None if it holds neither."""
    try:
        return float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        if clock := _CLOCK.fullmatch(cell):
            return _MIDNIGHT + 3600.0 * int(clock[1]) + 60.0 * int(clock[2]) + float(clock[3].replace(",", "."))
        return _seconds(cell) if _STAMP.fullmatch(cell) else None


def _seconds(stamp: str) -> float | None:
    """Date and time as ISO 8601 writes them, since the year 2000 [s]."""
    try:
        return float((np.datetime64(stamp[:29].rstrip("Z"), "ns") - _YEAR_2000) / np.timedelta64(1, "s"))
    except ValueError:
        return None


def _all(row: Sequence[str], columns: Sequence[int], comma: bool) -> bool:
    return all(not row[at] or number_in(row[at], comma) is not None for at in columns)


def _titles(line: tuple[str, ...] = (), above: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Column titles from the line above the numbers; where that holds units only, with the line above it.

    >>> _titles(("s", "V", "um"), ("Time", "Drive", "Position"))
    ('Time [s]', 'Drive [V]', 'Position [um]')
    """
    named = [cell for cell in line if cell]
    if above and named and all(is_unit(cell) for cell in named):
        return tuple(f"{title} [{plain(unit)}]" if unit else title for title, unit in zip(above, line, strict=True))
    return line


def _has_numbers(row: list[str], comma: bool) -> bool:
    numbers = sum(number_in(cell, comma) is not None for cell in row)
    return numbers >= 2 or numbers == len(row)
