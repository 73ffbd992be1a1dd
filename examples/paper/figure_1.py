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

"""Fig. 1: the modified Bouc-Wen loop beside the classical one.

The classical operator is symmetric under a half turn. The cubic term of the modified one bends both branches alike.
"""

from __future__ import annotations

import numpy as np
import published
from exhibit import MEASURED, STATIC, Exhibit, canvas, main
from numpy.typing import NDArray

from piezo_hysteresis import Model
from piezo_hysteresis.effects import Effect


def loop(effect: Effect, v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hysteresis output w of one operator, from rest at v[0]."""
    model = Model((effect,), sample_period=1.0, voltage_scale=1.0)
    return model.run(v, model.rest(v[0]))[0]


def asymmetry(v: NDArray[np.float64], w: NDArray[np.float64]) -> float:
    """How far the last loop is from its own half turn, in % of its height; 0 for a loop symmetric about its centre."""
    turned = np.roll(w, w.size // 2)
    centre = 0.5 * (w.max() + w.min())
    return published.percent_of_range(w - (2.0 * centre - turned), w)


def figure_1() -> Exhibit:
    """MBW against CBW with the parameters under Fig. 1, on a positive sine."""
    period, periods = 5000, 4
    v = 0.6 - 0.6 * np.cos(2.0 * np.pi * np.arange(periods * period) / period)
    last = slice(-period, None)
    classical, modified = (loop(e, v)[last] for e in (published.CBW_OF_FIGURE_1, published.MBW_OF_FIGURE_1))

    figure, axes = canvas(1, 2)
    numbers: dict[str, float | list[float]] = {}
    for ax, name, w, colour in zip(axes, ("CBW", "MBW"), (classical, modified), (MEASURED, STATIC), strict=True):
        numbers[f"asymmetry of {name} [% of height]"] = asymmetry(v[last], w)
        ax.plot(v[last], w, color=colour)
        ax.set(xlabel="input v [1]", ylabel="output w [1]")
        ax.set_title(f"{name}: {numbers[f'asymmetry of {name} [% of height]']:.2f} % from symmetric")
    cubic = published.MBW_OF_FIGURE_1["p1"] * v[last] ** 3
    numbers["MBW - CBW - p1 v^3, largest [1]"] = float(np.abs(modified - classical - cubic).max())
    return Exhibit("figure_1", figure, numbers)


if __name__ == "__main__":
    main(figure_1)
