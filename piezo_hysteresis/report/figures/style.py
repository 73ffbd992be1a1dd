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

"""Style of all figures on paper: colours of `palette`, and line styles that can be distinguished in a grey print.

The measurement is always the solid grey line, the prediction the dashed one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from ..palette import BLACK, BLUE, GREY, ORANGE

P = ParamSpec("P")
R = TypeVar("R")

MEASURED: dict[str, Any] = {"color": BLACK, "linestyle": "-", "linewidth": 1.4}
"""Line of the measurement."""
PREDICTED: dict[str, Any] = {"color": ORANGE, "linestyle": (0, (4, 2)), "linewidth": 1.4}
"""Line of the prediction."""
BEFORE: dict[str, Any] = {"color": BLUE, "linestyle": (0, (1, 1.2)), "linewidth": 1.4}
"""Line of the model before."""
FLOOR: dict[str, Any] = {"color": GREY, "linestyle": (0, (6, 2, 1, 2)), "linewidth": 1.2}
"""Line of the noise floor."""
RESIDUAL: dict[str, Any] = {"color": ORANGE, "linestyle": "-", "linewidth": 0.9}
"""Line of measured minus predicted."""

SETTINGS: Any = {
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.edgecolor": "#666666",
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "svg.fonttype": "path",
    "savefig.dpi": 150,
}
"""Settings of matplotlib for every figure."""

WIDTH = 9.0
"""Width of every figure [inch]."""


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw with `SETTINGS`, independent of the settings of the process."""

    @wraps(draw)
    def inside(*args: P.args, **options: P.kwargs) -> R:
        with mpl.rc_context(SETTINGS):
            return draw(*args, **options)

    return inside


def canvas(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """A figure without global state and its axes, shape (rows, columns).

    Parameters
    ----------
    rows, columns : int
        Grid of axes.
    height : float
        Height of the whole figure [inch].
    **options
        Passed on to `Figure.subplots`.
    """
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def plain_log(axis: Any) -> None:
    """Label a logarithmic axis with plain numbers at 1, 2, 5."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))


def legend_above(figure: Figure, handles: Mapping[str, Any], columns: int = 4) -> None:
    """One legend for the figure, outside of the panels.

    Parameters
    ----------
    figure : Figure
        Figure with constrained layout, which makes room for the legend.
    handles : mapping of str to Artist
        Artists by label.
    columns : int
        Largest number of columns.
    """
    legend = figure.legend(handles.values(), handles.keys(), loc="upper center", ncols=min(columns, len(handles)))
    # loc="outside upper center" does not exist in Matplotlib 3.6 of ROS 2 Jazzy
    taken = legend.get_window_extent().height / figure.bbox.height
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - taken - 0.01))


def handles_of(axes: Axes) -> dict[str, Any]:
    """Artists by label, in the order of drawing."""
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))
