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

"""Output for a person: tables on standard output, progress on standard error."""

from __future__ import annotations

import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from rich.cells import cell_len
from rich.console import Console, JustifyMethod
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from ..errors import counted, printable
from ..record import Notice
from ..report.tables.table import Table

WIDTH = 10_000
"""Width of the output to a file [characters]: tables take the width that they need, and no word is broken."""
BREAKS = re.compile(r"(?<=[…,;]) ")
"""Places inside a cell of numbers where a line may end."""
SPACE = re.compile(r"\s+")
"""Places inside a text where a line may end."""
LINE_INTERVAL = 10.0
"""Time between two lines of progress in a file [s]."""


class Output(Console):
    """A console that leaves the end of the reader to `main`; that of rich would exit with the status of bad data."""

    def on_broken_pipe(self) -> None:
        """Raise the `BrokenPipeError` again, for which rich calls this."""
        raise


def console() -> Console:
    """Standard output: lines end between words on a terminal, and are as long as they need elsewhere."""
    is_terminal = sys.stdout.isatty()
    width = None if is_terminal else max(WIDTH, shutil.get_terminal_size().columns)
    return Output(file=sys.stdout, highlight=False, markup=False, width=width, soft_wrap=not is_terminal)


def show(*tables: Table | None) -> None:
    """Print tables; None is skipped."""
    for table in tables:
        if table is None:
            continue
        out = console()
        drawn = RichTable(title=table.title, title_justify="left", title_style="bold", box=None, pad_edge=False)
        for column, width in enumerate(_widths(table, out.width)):
            justify: JustifyMethod = "right" if column in table.numeric else "left"
            drawn.add_column(table.header[column], justify=justify, header_style="underline", width=width)
        for row in table.rows:
            drawn.add_row(*map(printable, row))
        with out.capture() as text:
            out.print(drawn, crop=False)
        out.file.write("\n".join(line.rstrip() for line in text.get().splitlines()) + "\n")
        if table.note:
            out.print(table.note, style="dim")
        out.print()


def _widths(table: Table, available: int) -> list[int]:
    """Widths of the columns [characters]: as wide as the cells, else narrower, but no word or number is broken."""
    most, least = [], []
    for column, heading in enumerate(table.header):
        cells = [printable(row[column]) for row in table.rows]
        breaks = BREAKS if column in table.numeric else SPACE
        most.append(max(map(cell_len, (heading, *cells))))
        least.append(max(map(cell_len, (*heading.split(), *(part for cell in cells for part in breaks.split(cell))))))
    left = available - 2 * (len(most) - 1) - sum(least)
    wanted = sum(most) - sum(least)
    share = min(1.0, max(left, 0) / wanted) if wanted else 1.0
    return [low + int(share * (high - low)) for low, high in zip(least, most, strict=True)]


def show_notices(notices: Iterable[Notice]) -> None:
    """Print findings about the data, one line each."""
    out = console()
    for notice in notices:
        where = f" [{notice.phase}]" if notice.phase else ""
        out.print(f"{'caution' if notice.severe else 'note'}{where}: {notice.message}")


def severe_status(notices: Iterable[Notice]) -> int:
    """Exit status: 1 after severe findings in the data, which a last line then says, otherwise 0."""
    if not any(notice.severe for notice in notices):
        return 0
    console().print("Severe findings above: check the recording before you use it.", style="bold")
    return 1


PER_MINUTE = 250_000
"""Number of samples that a slow or busy computer processes in a minute, if there are many."""


def usual_time(size: int, least: str, minutes: int) -> str:
    """Usual duration of a task, printed before it begins.

    Parameters
    ----------
    size : int
        Number of samples.
    least : str
        Duration of a short task.
    minutes : int
        Usual limit of the duration, also on a busy computer, where `size` does not make it longer [min].

    Examples
    --------
    >>> usual_time(1_000_000, "2 s", 1)
    '1000000 samples; this usually takes 2 s to 4 min'
    """
    return f"{counted(size, 'sample')}; this usually takes {least} to {max(minutes, round(size / PER_MINUTE))} min"


@contextmanager
def progress(task: str, expected: str = "") -> Iterator[Callable[[str, float], None]]:
    """Show the progress of a long task on standard error: a bar, or without a terminal a line every 10 s.

    Parameters
    ----------
    task : str
        Name of the task, e.g. ``"identify"``.
    expected : str
        Usual duration, printed at the start.

    Yields
    ------
    callable
        Function of a word and the fraction done.
    """
    if expected:
        print(f"{task}: {expected}", file=sys.stderr, flush=True)
    if not sys.stderr.isatty():
        with _lines(task) as report_line:
            yield report_line
        return
    bar = Progress(
        TextColumn("{task.description:32s}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        console=Console(file=sys.stderr),
        transient=True,
    )
    with bar:
        number = bar.add_task(task, total=1.0)

        def report_progress(word: str, fraction: float) -> None:
            bar.update(number, description=f"{task}: {word}", completed=min(max(fraction, 0.0), 1.0))

        yield report_progress


@contextmanager
def _lines(task: str) -> Iterator[Callable[[str, float], None]]:
    """Print a line every `LINE_INTERVAL`, also during a longer step."""
    began, ended = time.monotonic(), threading.Event()
    latest = ("", 0.0)

    def report_progress(word: str, fraction: float) -> None:
        nonlocal latest
        latest = word, min(max(fraction, 0.0), 1.0)

    def write_lines() -> None:
        while not ended.wait(LINE_INTERVAL):
            word, fraction = latest
            elapsed = time.monotonic() - began
            print(f"{task}: {word}, {100 * fraction:.0f} %, {elapsed:.0f} s", file=sys.stderr, flush=True)

    writer = threading.Thread(target=write_lines, daemon=True)
    writer.start()
    try:
        yield report_progress
    finally:
        ended.set()
        writer.join()
