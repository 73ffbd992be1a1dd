"""`Table`: rows of text and numbers for a page or a terminal."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A table whose cells are already words.

    Parameters
    ----------
    title : str
        What the table holds.
    header : tuple of str
        Column headings.
    rows : tuple of tuple of str
        Cells; each row as long as the header.
    note : str
        What the reader must know; may be empty.
    numeric : frozenset of int
        Columns that are set flush right.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    numeric: frozenset[int] = frozenset()
