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

"""Probability of every explanation over the stage time of a live diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...palette import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from ...tables.probability_table import shown_explanations
from ..drawing import Drawing
from ..style import canvas, handles_of, legend_above, styled

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, BLACK)
"""Colours of the explanations, the likeliest first."""


@styled
def probabilities(live: Mapping[str, Any]) -> Drawing:
    """Steps of the probabilities, and the level from which the answer is certain.

    Parameters
    ----------
    live : mapping
        The part ``live`` of the answer of a diagnosis.
    """
    updates = live["probabilities"]
    names = shown_explanations(live, len(COLOURS))
    time = np.array([0.0, *(u["time_s"] for u in updates)])
    figure, ((axes,),) = canvas(1, 1, 3.2)
    data = {"time_s": time[1:]}
    for name, colour in zip(names, COLOURS, strict=False):
        p = np.array([u["probabilities"].get(name, 0.0) for u in updates])
        axes.plot(time[1:], 100.0 * p, marker="o", color=colour, label=name.replace("_", " "))
        data[name] = p
    sure = 100.0 * (1.0 - live["error_rate"])
    axes.axhline(sure, color=GREY, linestyle="--", label=f"certain, {sure:g} %")
    axes.set(xlabel="stage time [s]", ylabel="probability [%]", title="Probability of each explanation")
    axes.set_xlim(0.0, 1.05 * time[-1])
    axes.set_ylim(-3.0, 103.0)
    legend_above(figure, handles_of(axes))
    return Drawing(
        "probabilities",
        "Probability of each explanation",
        "After each group of phases, the gap finder computes the probability of every explanation. It stops when one "
        "of them is above the dashed line.",
        f"Probabilities over {time[-1]:.1f} s of stage time. {live['reason']}",
        figure,
        data,
    )
