"""Numbers and words from the columns of a text file, block by block, so that memory grows with the numbers only."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ...record import Samples
from ..segmentation.decimating_buffer import DecimatingBuffer
from .read_options import ReadOptions
from .units import is_unit, plain

BLOCK_BYTES = 1 << 20
"""Text that is parsed at a time; no line may be longer."""


_COMMENT = ("#", "%")
"""Beginnings of comment lines."""
_STAMP = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d+)?Z?")
"""A date with time of day."""
_YEAR_2000 = np.datetime64("2000-01-01", "ns")
"""Date from which times are counted."""
_NO_ROW = (b"#", b"%", b"\n\n", b"\n\r", b"\r\r", b"\n ", b"\n\t", b"\f", b"\v")
"""Bytes without which every line is a row: looking at each line takes longer than reading its numbers."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How the numbers of a text file are written.

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
        """Guess from the first block.

        Raises
        ------
        RecordingError
            If no line is followed by rows of two or more columns with numbers.
        """
        with path.open("rb") as file:
            block = file.read(BLOCK_BYTES // 4)
            lines = decoded(block).splitlines()
            if file.read(1) and len(lines) > 1:
                lines.pop()  # it may be cut
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
        if best is None:
            raise RecordingError("got no rows of numbers in two or more columns")
        return best[2]

    @classmethod
    def _with(cls, lines: Sequence[str], delimiter: str | None, comma: bool) -> tuple[float, int, Dialect] | None:
        rows = [[] if line.lstrip().startswith(_COMMENT) else _cells(line, delimiter) for line in lines]
        body = [row for row in rows if row][-40:]
        width = len(body[-1]) if body else 0
        of_numbers = [at for at in range(width) if _number(body[-1][at], comma) is not None]
        like = (i for i, row in enumerate(rows) if len(row) == width and _all(row, of_numbers, comma))
        first = next((i for i in like if _has_numbers(rows[i], comma)), None)
        if width < 2 or first is None:
            return None
        filled = [[cell for cell in row if cell] for row in body if len(row) == width]
        numeric = [np.mean([_number(cell, comma) is not None for cell in row]) for row in filled if row]
        above = [line for line in lines[:first] if line.strip(" \t,;#%")][-2:]
        titles = (_cells(line.lstrip(" #%"), delimiter) for line in reversed(above))
        header = _titles(*(tuple(cells) if len(cells) == width else () for cells in titles))
        return float(np.sum(numeric)) / len(body), width, cls(delimiter, comma, first, header, width)


@dataclass(frozen=True, eq=False, slots=True)
class Cells:
    """What was read of a text file."""

    columns: dict[str, Samples]
    """The numbers, each of shape (n,); NaN where a cell is empty or no number."""
    marks: list[tuple[int, dict[str, str]]]
    """The words and the first row kept at which they are those; empty without words."""
    bad: int
    """Cells that are no number."""
    average: int
    """Rows that were averaged into one."""


def decoded(block: bytes) -> str:
    """Text in UTF-8, or else in the Latin-1 of older instruments."""
    try:
        return block.decode("utf-8-sig")
    except UnicodeDecodeError:
        return block.decode("latin-1")


def read_cells(
    path: Path, dialect: Dialect, numbers: Mapping[str, int], words: Mapping[str, int], options: ReadOptions
) -> Cells:
    """Read columns of a text file.

    Parameters
    ----------
    path : Path
        The file.
    dialect : Dialect
        How it is written.
    numbers, words : mapping of str to int
        Name of every column to read to its position, counted from 0.
    options : ReadOptions
        Its `rows`, where they count from the beginning, and its `average` apply before anything is kept.

    Raises
    ------
    RecordingError
        On a line that is longer than a block, or more samples than can be kept.
    """
    buffer = DecimatingBuffer.of(len(numbers), options)
    marks: list[tuple[int, dict[str, str]]] = []
    bad = 0
    for lines in _line_blocks(path, dialect.skipped):
        first, behind = buffer.rows, buffer.rows + len(lines)
        if behind > buffer.start:
            values, wrong = _parsed(lines, dialect, list(numbers.values()))
            bad += wrong
        else:
            values = np.empty((len(lines), len(numbers)))  # passed over
        buffer.add(values)
        if words and behind > buffer.start:
            cells = _labels(lines, dialect, list(words.values()))
            changes = np.flatnonzero((cells[1:] != cells[:-1]).any(axis=1)) + 1
            for row in (0, *changes.tolist()):
                labels = dict(zip(words, map(str, cells[row]), strict=True))
                if not marks or marks[-1][1] != labels:
                    marks.append((first + row, labels))
        if buffer.is_full:
            break
    columns = {name: buffer.column(at) for at, name in enumerate(numbers)}
    return Cells(columns, [(buffer.kept_row(row), labels) for row, labels in marks], bad, buffer.factor)


def _line_blocks(path: Path, skipped: int) -> Iterator[list[str]]:
    """Rows of a file, without empty lines and comments, about a block at a time."""
    with path.open("rb") as file:
        rest = b""
        ended = False
        while not ended:
            block = file.read(BLOCK_BYTES)
            ended = not block
            whole, newline, rest = ((rest + block), b"", b"") if ended else (rest + block).rpartition(b"\n")
            if len(rest) > BLOCK_BYTES:
                raise RecordingError(f"got a line of more than {BLOCK_BYTES} bytes, expected a text table")
            lines = decoded(whole + newline).splitlines()
            used = min(skipped, len(lines))
            skipped -= used
            rows = lines[used:]
            if not rows or not rows[-1].strip() or any(mark in whole for mark in _NO_ROW):
                rows = [line for line in rows if line.strip() and not line.lstrip().startswith(_COMMENT)]
            if rows:
                yield rows


def _parsed(lines: list[str], dialect: Dialect, columns: list[int]) -> tuple[Samples, int]:
    text = [line.replace(",", ".") for line in lines] if dialect.decimal_comma else lines
    try:
        values = np.loadtxt(text, delimiter=dialect.delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"')
        return values, 0
    except (ValueError, IndexError):  # an empty or wrong cell somewhere: look at every one
        values = np.full((len(lines), len(columns)), np.nan)
        bad = 0
        for i, line in enumerate(lines):
            row = _cells(line, dialect.delimiter)
            for j, at in enumerate(columns):
                number = _number(row[at], dialect.decimal_comma) if at < len(row) else None
                bad += number is None
                values[i, j] = np.nan if number is None else number
        return values, bad


def _labels(lines: list[str], dialect: Dialect, columns: list[int]) -> NDArray[np.str_]:
    try:
        return np.loadtxt(
            lines, str, delimiter=dialect.delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"'
        )
    except (ValueError, IndexError):
        rows = [_cells(line, dialect.delimiter) for line in lines]
        return np.array([[row[at] if at < len(row) else "" for at in columns] for row in rows])


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)] if line.strip() else []
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _number(cell: str, comma: bool) -> float | None:
    try:
        return float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return _seconds(cell) if _STAMP.fullmatch(cell) else None


def _seconds(stamp: str) -> float | None:
    """Date and time as ISO 8601 writes them, since the year 2000 [s]."""
    try:
        return float((np.datetime64(stamp[:29].rstrip("Z"), "ns") - _YEAR_2000) / np.timedelta64(1, "s"))
    except ValueError:
        return None


def _all(row: Sequence[str], columns: Sequence[int], comma: bool) -> bool:
    return all(not row[at] or _number(row[at], comma) is not None for at in columns)


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
    numbers = sum(_number(cell, comma) is not None for cell in row)
    return numbers >= 2 or numbers == len(row)
