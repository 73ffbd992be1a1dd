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

"""`Picture`: the result of `plot` of a record, a model or a result, drawn by `report`.

No module below `report` may import `report`. The package therefore registers the drawing function by `draw_with`, and
loads it when the first picture is requested, so that matplotlib is not imported before.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, Protocol


class Picture(Protocol):
    """A figure that a notebook shows by itself."""

    @property
    def caption(self) -> str:
        """Explanation of the figure."""

    @property
    def figure(self) -> Any:
        """The `matplotlib.figure.Figure`."""

    @property
    def data(self) -> Mapping[str, Any]:
        """The data of the figure as columns, with units in their names."""

    def save_picture(self, path: str | os.PathLike[str]) -> None:
        """Write a new file; its ending chooses the format: .png, .svg, .pdf."""


Draw = Callable[..., Picture]


class Pictured:
    """Base class of objects that can be drawn: a record, an experiment, a diagnosis."""

    __slots__ = ()

    def plot(self) -> Picture:
        """Records against time and as loops; a diagnosis as the gap before and after. A notebook shows the picture."""
        return picture_of(self)


_loaders: list[Callable[[], Draw]] = []


def draw_with(load: Callable[[], Draw]) -> None:
    """Register the function that loads the drawing function; the package does this when it is imported."""
    _loaders[:] = [load]


def picture_of(*what: object) -> Picture:
    """The picture of an object, or of a model with an experiment, as `piezo_hysteresis.plot` draws it."""
    draw = _loaders[0]()
    return draw(*what)
