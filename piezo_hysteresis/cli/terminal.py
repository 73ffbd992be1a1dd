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

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from ..errors import printable
from ..record import Notice
from ..report.tables.table import Table

WIDTH = 10_000
"""Width of the output to a file [characters]: tables take the width that they need, and no word is broken."""
LINE_INTERVAL = 10.0
"""Time between two lines of progress in a file [s]."""


def console() -> Console:
    """Standard output; plain text where it is not a terminal."""
    width = None if sys.stdout.isatty() else max(WIDTH, shutil.get_terminal_size().columns)
    return Console(file=sys.stdout, highlight=False, markup=False, width=width, soft_wrap=True)


def show(*tables: Table | None) -> None:
    """Print tables; None is skipped."""
    for table in tables:
        if table is None:
            continue
        drawn = RichTable(title=table.title, title_justify="left", title_style="bold", box=None, pad_edge=False)
        for column, heading in enumerate(table.header):
            drawn.add_column(heading, justify="right" if column in table.numeric else "left", header_style="underline")
        for row in table.rows:
            drawn.add_row(*map(printable, row))
        out = console()
        out.print(drawn)
        if table.note:
            out.print(table.note, style="dim")
        out.print()


def show_notices(notices: Iterable[Notice]) -> None:
    """Print findings about the data, one line each."""
    out = console()
    for notice in notices:
        where = f" [{notice.phase}]" if notice.phase else ""
        out.print(f"{'caution' if notice.severe else 'note'}{where}: {notice.message}")


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
