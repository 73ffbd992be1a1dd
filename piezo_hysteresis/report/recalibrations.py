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

"""Parameters of a model over the recalibrations of its stage."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from ..changes.recalibration_history import RecalibratedNumber
from ..errors import RecordingError
from .figures.drawing import Drawing
from .figures.style import MEASURED, RESIDUAL, canvas, styled


@styled
def recalibrations(numbers: Sequence[RecalibratedNumber]) -> Drawing:
    """One panel for every parameter with its intervals, and the residual before and after.

    Raises
    ------
    RecordingError
        If nothing has been recalibrated.
    """
    if not numbers:
        raise RecordingError("the history contains no recalibration, expected at least one")
    names = list(dict.fromkeys(number.parameter for number in numbers))
    figure, axes = canvas(len(names) + 1, 1, 1.6 + 1.7 * len(names), sharex=True)
    times = np.array([datetime.fromisoformat(n.time).replace(tzinfo=None) for n in numbers], dtype="datetime64[s]")
    for axis, name in zip(axes[:, 0], names, strict=False):
        at = [k for k, n in enumerate(numbers) if n.parameter == name]
        rows = [numbers[k] for k in at]
        new = np.array([n.new for n in rows])
        interval = np.abs(np.array([[n.new - n.low, n.high - n.new] for n in rows]).T)
        steps = np.array([rows[0].old, *new])
        axis.step(times[[at[0], *at]], steps, where="post", **RESIDUAL)
        axis.errorbar(times[at], new, interval, fmt="o", markersize=3, capsize=2, color=str(MEASURED["color"]))
        axis.set_ylabel(name if rows[0].unit in ("", "1") else f"{name} [{rows[0].unit}]")
    for label, marker in (("before", "s"), ("after", "o"), ("baseline", "_")):
        values = [1e9 * getattr(n, f"residual_{label}") for n in numbers]
        axes[-1, 0].plot(times, values, marker, markersize=5, label=label)
    axes[-1, 0].set_ylabel("residual [nm]")
    axes[-1, 0].set_yscale("log")
    axes[-1, 0].legend(loc="best")
    axes[-1, 0].set_xlabel("time [UTC]")
    last = numbers[-1]
    return Drawing(
        "recalibrations",
        "Recalibrations",
        "Parameters of the model over time with 95 % intervals, and the RMS residual before and after every "
        "recalibration, compared with that of the baseline.",
        f"{len(numbers)} changes of {len(names)} numbers; the last one at {last.time}: {last.parameter} from "
        f"{last.old:.6g} to {last.new:.6g} {last.unit}.",
        figure,
        {
            "time": np.array([n.time for n in numbers]),
            "parameter": np.array([n.parameter for n in numbers]),
            **{c: np.array([getattr(n, c) for n in numbers]) for c in ("old", "new", "low", "high")},
        },
    )
