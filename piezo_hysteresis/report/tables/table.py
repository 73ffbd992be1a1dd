"""`Table`: rows of words and numbers, to be read on a page or in a terminal."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape


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

    def html(self) -> str:
        """The table as HTML that can be reached and scrolled by keyboard."""

        def cell(column: int, text: str, tag: str, more: str = "") -> str:
            several = ", " in text  # coefficients: one number a line would do, one line for all would not
            style = f' class="{"several" if several else "n"}"' if column in self.numeric else ""
            return f"<{tag}{more}{style}>{escape(text)}</{tag}>"

        head = "".join(cell(i, text, "th", ' scope="col"') for i, text in enumerate(self.header))
        body = "".join(
            "<tr>"
            + cell(0, row[0], "th", ' scope="row"')
            + "".join(cell(i, text, "td") for i, text in enumerate(row[1:], 1))
            + "</tr>\n"
            for row in self.rows
        )
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return (
            f'<div class="table" role="region" tabindex="0" aria-label="{escape(self.title)}"><table>'
            f"<caption>{escape(self.title)}</caption><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>{note}\n"
        )
