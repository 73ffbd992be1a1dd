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

"""`make bench`: the figures of docs/performance, each compared with another implementation in the same run.

Without a name, the benchmarks of speed run, which takes some minutes. The options of one benchmark are given on its own
command line, e.g. `python -m benchmarks.streaming --rate 2e5`.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path

from benchmarks.figures import Figures, console, machine, show, write

SPEED = ("kernels", "simulation", "identification", "growth", "start", "streaming", "diagnosis")
"""Benchmarks that run by default."""
QUALITY = (
    "change",
    "changes",
    "compensation",
    "export",
    "fleet",
    "page",
    "prediction",
    "rates",
    "recovery",
    "table_1",
    "real_recordings",
    "reading",
    "mirror",
    "one_amplitude",
    "one_process",
)
"""Benchmarks that take minutes or need data; they run by name only."""


def main() -> int:
    """Run benchmarks with their defaults; returns 1 if a promise was not kept."""
    parser = argparse.ArgumentParser(
        prog="benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"{', '.join(SPEED + QUALITY)} (default: the first {len(SPEED)})"
    )
    parser.add_argument("--json", type=Path, default=Path("benchmarks.json"), help="default: benchmarks.json")
    chosen = parser.parse_args()
    unknown = [name for name in chosen.names if name not in SPEED + QUALITY]
    if unknown:
        parser.error(f"no benchmark '{unknown[0]}', expected some of {', '.join(SPEED + QUALITY)}")
    out, results = console(), dict[str, list[Figures]]()
    out.print(", ".join(f"{key} {value}" for key, value in machine().items()), highlight=False)
    for name in chosen.names or SPEED:
        begin = time.monotonic()
        module = importlib.import_module(f"benchmarks.{name}")
        options = argparse.ArgumentParser()
        module.arguments(options)
        results[name] = module.run(options.parse_args([]))
        show(results[name])
        out.print(f"[dim]{name}: {time.monotonic() - begin:.0f} s; python -m benchmarks.{name} --help[/]\n")
        write(results, chosen.json)
    out.print(f"written: {chosen.json}")
    return int(any(figures.failures for group in results.values() for figures in group))


if __name__ == "__main__":
    sys.exit(main())
