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

"""Results of every benchmark, shown as tables on the terminal and stored in a JSON file.

A benchmark is a module with ``arguments(parser)``, its options with defaults, and ``run(options)``, which returns a
list of `Figures`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

Cell = str | int | float | None

WIDTH = 10_000
"""Width of the output to a file [characters]: no word is broken."""


@dataclass(frozen=True)
class Figures:
    """A table of a benchmark.

    Parameters
    ----------
    title : str
        Quantity and method of the measurement.
    columns : tuple of str
        Heads, with units.
    rows : list of tuple
        One cell per column: text, or numbers with full precision.
    failures : tuple of str
        Promises that were not kept; any of them makes the exit code 1.
    """

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    failures: tuple[str, ...] = ()

    def table(self) -> Table:
        """The table, numbers to three digits."""
        table = Table(title=self.title, title_justify="left")
        for k, column in enumerate(self.columns):
            words = all(isinstance(row[k], str) for row in self.rows)
            table.add_column(column, justify="left" if words else "right", overflow="fold")
        for row in self.rows:
            table.add_row(*(_shown(cell) for cell in row))
        return table


def seconds(*works: Callable[[], object], repeats: int = 5) -> list[float]:
    """Shortest processor time of every work [s], measured alternately, so that other load affects all of them."""
    best = [np.inf] * len(works)
    for work in works:
        work()
    for _ in range(repeats):
        for k, work in enumerate(works):
            start = time.process_time()
            work()
            best[k] = min(best[k], time.process_time() - start)
    return best


def machine() -> dict[str, Any]:
    """Where and when the figures were taken, and how busy the machine was."""
    cpu = Path("/proc/cpuinfo")
    lines = cpu.read_text().splitlines() if cpu.is_file() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return {
        "cpu": model or platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def console() -> Console:
    """Standard output; where it is not a terminal, tables take the width that they need."""
    return Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)


def show(figures: list[Figures]) -> None:
    """Print the tables, and below each the promises that were not kept."""
    out = console()
    for one in figures:
        out.print(one.table())
        for failure in one.failures:
            out.print(f"[red]failed:[/] {failure}")


def write(results: dict[str, list[Figures]], path: Path) -> None:
    """All results as JSON."""
    document = {"machine": machine(), "benchmarks": {n: [asdict(f) for f in r] for n, r in results.items()}}
    path.write_text(json.dumps(document, indent=1) + "\n")


def alone(module: str) -> None:
    """Command line of one benchmark: its own options, its tables, and exit code 1 where a promise was not kept."""
    benchmark = sys.modules[module]
    parser = argparse.ArgumentParser(description=(benchmark.__doc__ or "").splitlines()[0])
    benchmark.arguments(parser)
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    figures = benchmark.run(options)
    show(figures)
    if options.json:
        write({Path(benchmark.__file__ or module).stem: figures}, options.json)
    sys.exit(any(f.failures for f in figures))


def _shown(cell: Cell) -> str:
    if cell is None:
        return "–"
    return f"{cell:.3g}" if isinstance(cell, float) else str(cell)
