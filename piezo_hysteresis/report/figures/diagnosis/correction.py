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

"""The shape of a correction without a name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...palette import ORANGE
from ..drawing import Drawing
from ..style import canvas, styled

LABELS = {"m": (1e6, "µm"), "s": (1.0, "s"), "1": (1.0, "1"), "1/decade": (100.0, "%/decade")}
"""Factor and unit of an axis, by the unit of the values."""
SMALL = (1e9, "nm")
"""Factor and unit of deviations, by the unit of the values."""


@styled
def correction(answer: Mapping[str, Any]) -> Drawing | None:
    """The shape of an accepted correction; None if there is none.

    Parameters
    ----------
    answer : mapping
        Answer of a diagnosis, as in the JSON file.
    """
    found = answer.get("unnamed_correction")
    if not found or not found["accepted"]:
        return None
    x, y = found["shape"]["x"], found["shape"]["y"]
    (wide, x_unit), (high, y_unit) = LABELS[x["unit"]], SMALL if y["unit"] == "m" else LABELS[y["unit"]]
    along, up = wide * np.array(x["values"]), high * np.array(y["values"])
    figure, ((axes,),) = canvas(1, 1, 2.6)
    axes.plot(along, up, marker="o", markersize=3, color=ORANGE)
    axes.set(xlabel=f"{x['name']} [{x_unit}]", ylabel=f"{y['name']} [{y_unit}]", title="Correction without a name")
    if x["unit"] == "s":
        axes.set_xscale("log")
    return Drawing(
        "correction",
        "Correction without a name",
        "The correction describes a residual that no effect of the catalogue explains. It does not state the cause. It "
        "is valid only for voltages, frequencies and rates inside the recorded range.",
        f"Correction without a name as a function of the {found['depends_on']}. {found['reason']}",
        figure,
        {_column(x["name"], x_unit): along, _column(y["name"], y_unit): up},
    )


def _column(name: str, unit: str) -> str:
    words = (name, "" if unit == "1" else unit.replace("%", "percent").replace("/", "_per_").replace("µ", "u"))
    return "_".join(w for w in words if w).replace(" ", "_")
