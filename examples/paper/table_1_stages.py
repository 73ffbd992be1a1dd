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

"""Table 1 on the simulated stages: free-run error of the dynamic model and of MBW alone, on sines held out of the fit.

On the Bouc-Wen stage the dynamic model is as good as the sensor, 0.05 % of the full stroke. On the Prandtl-Ishlinskii
stage, as on a real piezo, a Bouc-Wen model has a residual that its loop cannot describe. In both stages the error of
MBW alone grows with frequency because of the lag of G.
"""

from __future__ import annotations

import published
from exhibit import DYNAMIC, STATIC, Exhibit, canvas, main
from two_stages import OPERATORS, TITLES, alone, experiment, joint

from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.model.model import Model


def errors_by_frequency(model: Model, operator: str) -> list[float]:
    """RMS error of whole phases in % of the range of the experiment, at the frequencies of Table 1."""
    return list(errors(model, experiment(operator)).by_frequency.values())


def table_1_stages() -> Exhibit:
    """The table for both stages."""
    figure, axes = canvas(1, 2, sharey=True)
    numbers: dict[str, float | list[float]] = {"frequency [Hz]": list(published.FREQUENCIES)}
    for ax, operator in zip(axes, OPERATORS, strict=True):
        dynamic = joint(operator).model
        for name, model, color in (("dynamic model", dynamic, DYNAMIC), ("MBW alone", alone(dynamic), STATIC)):
            row = errors_by_frequency(model, operator)
            ax.semilogy(published.FREQUENCIES, row, "o-", color=color, label=name)
            numbers[f"{TITLES[operator]}, {name} [% of range]"] = row
        ax.set(xlabel="frequency [Hz]", title=TITLES[operator])
        ax.legend()
    axes[0].set_ylabel("RMS error in free run [% of range]")
    return Exhibit("table_1_stages", figure, numbers)


if __name__ == "__main__":
    main(table_1_stages)
