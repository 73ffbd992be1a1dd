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

"""`Exhibit`: a figure, and the numbers that a test compares."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

# Okabe and Ito's palette: distinguished by colour-blind readers, and in grey
MEASURED, DYNAMIC, STATIC, THIRD = "#000000", "#0072B2", "#D55E00", "#009E73"


@dataclass(frozen=True, eq=False)
class Exhibit:
    """One figure of the paper, remade.

    Parameters
    ----------
    name : str
        File name without ending, e.g. ``"figure_1"``.
    figure : matplotlib.figure.Figure
        The picture.
    numbers : dict
        Numbers that a test checks: name with unit to a number or a list of numbers.
    """

    name: str
    figure: Figure
    numbers: dict[str, float | list[float]]

    def save(self, folder: Path) -> Path:
        """Write ``<name>.png`` and ``<name>.json`` into `folder`; returns the path of the figure."""
        folder.mkdir(parents=True, exist_ok=True)
        picture = folder / f"{self.name}.png"
        self.figure.savefig(picture, dpi=110)
        plt.close(self.figure)
        text = json.dumps(self.numbers, indent=2, default=lambda value: round(float(value), 6))
        picture.with_suffix(".json").write_text(text + "\n")
        return picture


def canvas(rows: int = 1, columns: int = 1, **options: object) -> tuple[Figure, list[plt.Axes]]:
    """A figure and its axes, row by row."""
    figure, axes = plt.subplots(
        rows, columns, squeeze=False, layout="constrained", figsize=(4.6 * columns + 0.4, 3.3 * rows + 0.3), **options
    )
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    return figure, list(axes.flat)


def main(make: Callable[[], Exhibit]) -> None:
    """Make the exhibit, write it where the command line says, print its numbers."""
    parser = argparse.ArgumentParser(description=make.__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("demo/paper"), help="folder for figure and numbers")
    exhibit = make()
    print(f"{exhibit.save(parser.parse_args().output)}")
    for name, value in exhibit.numbers.items():
        numbers = value if isinstance(value, list) else [value]
        print(f"  {name}: {'  '.join(f'{number:.4g}' for number in numbers)}")
