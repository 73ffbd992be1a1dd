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

"""Reads numbers and words from the columns of a text file block by block, so that only the numbers take memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ...record import Samples
from ..segmentation.decimating_buffer import DecimatingBuffer
from .dialect import COMMENT, Dialect, cells_of, decoded, number_in
from .read_options import ReadOptions

BLOCK_BYTES = 1 << 20
"""Number of bytes that are parsed together; no line may be longer."""


_NO_ROW = (b"#", b"%", b"\n\n", b"\n\r", b"\r\r", b"\n ", b"\n\t", b"\f", b"\v")
"""If a block contains none of these, every line is a row; checking each line would take longer than reading it."""


@dataclass(frozen=True, eq=False, slots=True)
class Cells:
    """Content of a text file."""

    columns: dict[str, Samples]
    """The numbers, each of shape (n,); NaN where a cell is empty or no number."""
    marks: list[tuple[int, dict[str, str]]]
    """First kept row of every combination of words, and the words; empty without words."""
    bad: int
    """Number of cells that do not hold a number."""
    example: str
    """The first of them that is not empty, if there is one."""
    average: int
    """Rows that were averaged into one."""
    is_cut: bool
    """Whether the file ends within a row, which is left out."""


class _Part:
    """A part of a text file while it is read: the options choose its rows."""

    def __init__(self, width: int, options: ReadOptions) -> None:
        self.buffer = DecimatingBuffer.of(width, options)
        self.marks: list[tuple[int, dict[str, str]]] = []
        self.bad = 0
        self.example = ""

    def overlaps(self, rows: int) -> bool:
        """Whether the part holds some of the next rows."""
        return not self.buffer.is_full and self.buffer.rows + rows > self.buffer.start

    def mark(self, labelled: Iterable[tuple[int, dict[str, str]]]) -> None:
        """Note where the words change within the next rows."""
        for row, labels in labelled:
            if not self.marks or self.marks[-1][1] != labels:
                self.marks.append((self.buffer.rows + row, labels))

    def cells(self, names: Iterable[str], is_cut: bool) -> Cells:
        """What was read."""
        buffer = self.buffer
        columns = {name: buffer.column(at) for at, name in enumerate(names)}
        return Cells(
            columns,
            [(buffer.kept_row(row), labels) for row, labels in self.marks],
            self.bad,
            self.example,
            buffer.factor,
            is_cut,
        )


def read_cells(
    path: Path, dialect: Dialect, numbers: Mapping[str, int], words: Mapping[str, int], parts: Sequence[ReadOptions]
) -> list[Cells]:
    """Read columns of one or more parts of a text file, all in one pass.

    Parameters
    ----------
    path : Path
        The file.
    dialect : Dialect
        Its notation.
    numbers, words : mapping of str to int
        Name of every column to read to its position, counted from 0.
    parts : sequence of ReadOptions
        One for every part: its `rows`, where they count from the beginning, and its `average` apply before anything is
        kept.

    Raises
    ------
    RecordingError
        On a line that is longer than a block, or more samples than can be kept.
    """
    read = [_Part(len(numbers), options) for options in parts]
    is_cut, before = False, ""
    for lines, is_last in _line_blocks(path, dialect.skipped):
        if is_last and _is_cut(lines[-1], before, dialect):
            is_cut = True
            break
        before = lines[-1]
        holders = [part for part in read if part.overlaps(len(lines))]
        values, wrong, example = np.empty((len(lines), len(numbers))), 0, ""  # of skipped rows, if no part holds them
        if holders:
            values, wrong, example = _parsed(lines, dialect, list(numbers.values()))
        if holders and words:
            cells = _labels(lines, dialect, list(words.values()))
            changes = np.flatnonzero((cells[1:] != cells[:-1]).any(axis=1)) + 1
            labelled = [(row, dict(zip(words, map(str, cells[row]), strict=True))) for row in (0, *changes.tolist())]
            for part in holders:
                part.mark(labelled)
        for part in read:
            if part in holders:
                part.bad += wrong
                part.example = part.example or example
            part.buffer.add(values)
        if all(part.buffer.is_full for part in read):
            break
    return [part.cells(numbers, is_cut) for part in read]


def _is_cut(line: str, before: str, dialect: Dialect) -> bool:
    """Whether a line that has no end lacks cells, or the rest of a word of the line before."""
    cells, last = cells_of(line, dialect.delimiter), cells_of(before, dialect.delimiter)[-1:]
    if not before or len(cells) < dialect.width:
        return bool(before)
    is_word = number_in(last[0], dialect.decimal_comma) is None
    return is_word and cells[-1] != last[0] and last[0].startswith(cells[-1])


def _line_blocks(path: Path, skipped: int) -> Iterator[tuple[list[str], bool]]:
    """Rows of a file, without empty lines and comments, about a block at a time; True with a last row without end."""
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
                rows = [line for line in rows if line.strip() and not line.lstrip().startswith(COMMENT)]
            if rows:
                yield rows, ended


def _parsed(lines: list[str], dialect: Dialect, columns: list[int]) -> tuple[Samples, int, str]:
    """Numbers, how many cells hold none, and the first of them that is not empty."""
    text = [line.replace(",", ".") for line in lines] if dialect.decimal_comma else lines
    try:
        values = np.loadtxt(text, delimiter=dialect.delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"')
        return values, 0, ""
    except (ValueError, IndexError):  # a cell is empty or wrong: every cell is parsed by itself
        values = np.full((len(lines), len(columns)), np.nan)
        bad, example = 0, ""
        for i, line in enumerate(lines):
            row = cells_of(line, dialect.delimiter)
            for j, at in enumerate(columns):
                cell = row[at] if at < len(row) else ""
                number = number_in(cell, dialect.decimal_comma)
                if number is None:
                    bad, example = bad + 1, example or cell
                values[i, j] = np.nan if number is None else number
        return values, bad, example


def _labels(lines: list[str], dialect: Dialect, columns: list[int]) -> NDArray[np.str_]:
    try:
        return np.loadtxt(
            lines, str, delimiter=dialect.delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"'
        )
    except (ValueError, IndexError):
        rows = [cells_of(line, dialect.delimiter) for line in lines]
        return np.array([[row[at] if at < len(row) else "" for at in columns] for row in rows])
