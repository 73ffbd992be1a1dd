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

"""Fig. 9: a triangle of 100 Hz that was not fitted: the dynamic model and MBW alone against the measurement."""

from __future__ import annotations

import numpy as np
import published
from exhibit import DYNAMIC, MEASURED, STATIC, Exhibit, canvas, main
from two_stages import alone, experiment, joint, last_period


def figure_9() -> Exhibit:
    """The last two periods, and the residual of each model."""
    record = experiment("bouc_wen").named("triangle_100hz")[0]
    end = last_period(record, 100.0, level=1.0).stop
    part = slice(end - 2 * round(0.01 / record.sample_period), end)
    measured = record.displacement[part]
    time = 1e3 * record.sample_period * np.arange(measured.size)

    figure, (above, below) = canvas(1, 2)
    above.plot(time, measured * 1e6, color=MEASURED, label="measured")
    numbers: dict[str, float | list[float]] = {}
    for name, model, colour in (
        ("dynamic model", joint("bouc_wen").model, DYNAMIC),
        ("MBW alone", alone(joint("bouc_wen").model), STATIC),
    ):
        predicted = model.simulate(record)[0][part]
        error = published.percent_of_range(measured - predicted, measured)
        numbers[f"{name} [% of peak-to-peak]"] = error
        above.plot(time, predicted * 1e6, "--", color=colour, label=name)
        below.plot(time, (measured - predicted) * 1e6, color=colour, label=f"{name}: {error:.2f} %")
    above.set(xlabel="time [ms]", ylabel="y [µm]")
    below.set(xlabel="time [ms]", ylabel="measured − predicted [µm]")
    above.legend()
    below.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return Exhibit("figure_9", figure, numbers)


if __name__ == "__main__":
    main(figure_9)
