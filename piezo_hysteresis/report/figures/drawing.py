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

"""`Drawing`: a figure, its caption, and its data."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...errors import RecordingError
from .style import SETTINGS


@dataclass(frozen=True, eq=False)
class Drawing:
    """One figure of a report.

    Parameters
    ----------
    name : str
        File name without ending, e.g. ``"loops"``.
    title : str
        Heading.
    caption : str
        Explanation of the figure.
    alternative : str
        Text with the result for readers who cannot see the figure.
    figure : Figure
        The picture.
    data : mapping of str to (n,) ndarray
        Data of the figure as columns with units in their names; lengths may differ.
    """

    name: str
    title: str
    caption: str
    alternative: str
    figure: Figure
    data: Mapping[str, NDArray[Any]]

    def __post_init__(self) -> None:
        with mpl.rc_context(SETTINGS):
            self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # computed once, the same for every format

    def __repr__(self) -> str:
        return f"Drawing({self.name}: {self.alternative})"

    def svg(self) -> str:
        """The figure as SVG text, identical for identical data."""
        return self._svg

    @cached_property
    def _svg(self) -> str:
        """Drawn once for the page and for the file beside it."""
        stream = io.StringIO()
        with mpl.rc_context({**SETTINGS, "svg.hashsalt": self.name}):
            self.figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        return stream.getvalue()

    def _repr_svg_(self) -> str:
        return self.svg()

    def csv(self) -> str:
        """The data of the figure as CSV; shorter columns end early."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(self.data)
        columns = [np.asarray(c) for c in self.data.values()]
        for i in range(max((c.size for c in columns), default=0)):
            writer.writerow(_cell(c[i]) if i < c.size else "" for c in columns)
        return stream.getvalue()

    def save_picture(self, path: str | os.PathLike[str]) -> None:
        """Write the figure in the format given by the ending of the path.

        Raises
        ------
        RecordingError
            If the ending is not known, or the file cannot be written.
        """
        if (ending := Path(path).suffix).lower() not in (".png", ".svg", ".pdf"):
            raise RecordingError(f"{path}: got the ending '{ending}', expected .png, .svg or .pdf")
        try:
            with mpl.rc_context(SETTINGS):
                self.figure.savefig(path)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}, expected a file that can be written") from None

    def save(self, folder: Path) -> None:
        """Write ``name.svg``, ``name.png`` and ``name.csv`` into a folder, which is made if it is missing.

        Raises
        ------
        RecordingError
            If a file cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{self.name}.svg").write_text(self.svg(), encoding="utf-8")
            with mpl.rc_context(SETTINGS):
                self.figure.savefig(folder / f"{self.name}.png", metadata={"Software": None})
            (folder / f"{self.name}.csv").write_text(self.csv(), encoding="utf-8")
        except OSError as error:
            place = folder / self.name
            raise RecordingError(f"{place}: {error.strerror or error}, expected a figure that can be written") from None


def _cell(value: object) -> str:
    return f"{value:.7g}" if isinstance(value, float | np.floating) else str(value)
