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

"""Fig. 6: the triangle of several amplitudes, and the MBW loop fitted to it in step 3.

At 1 Hz the stage acts as its dc gain K and its delay d, so w(i) = y(i + d)/K. The paper reaches 0.73 %. A Bouc-Wen
stage is fitted down to its noise. Bouc-Wen can only approach a Prandtl-Ishlinskii stage: a residual remains, as for a
real piezo.
"""

from __future__ import annotations

import published
from exhibit import MEASURED, STATIC, Exhibit, canvas, main
from two_stages import OPERATORS, TITLES, experiment, published_steps


def figure_6() -> Exhibit:
    """Measured and fitted loops of both stages."""
    figure, axes = canvas(1, 2)
    numbers: dict[str, float | list[float]] = {}
    for ax, operator in zip(axes, OPERATORS, strict=True):
        record, model = experiment(operator).named("triangle")[0], published_steps(operator).model
        w = record.displacement / (model.displacement_scale * model["arx"].dc_gain)
        fitted = model.simulate(record)[0] / (model.displacement_scale * model["arx"].dc_gain)
        error = published.percent_of_range(w - fitted, w)
        numbers[f"MBW fit, {TITLES[operator]} [% of peak-to-peak]"] = error
        v = record.voltage / model.voltage_scale
        ax.plot(v, w, color=MEASURED, label="measured, y(i + d)/K")
        ax.plot(v, fitted, "--", color=STATIC, label="MBW")
        ax.set(xlabel="input v [1]", ylabel="hysteresis output w [1]")
        ax.set_title(f"{TITLES[operator]}: RMS error {error:.2f} %")
    axes[0].legend()
    return Exhibit("figure_6", figure, numbers)


if __name__ == "__main__":
    main(figure_6)
