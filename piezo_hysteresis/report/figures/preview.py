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

"""Preview of a recording: drive and displacement against time, and displacement against drive."""

from __future__ import annotations

import numpy as np

from ...errors import counted
from ...record import Experiment
from .drawing import Drawing
from .style import MEASURED, canvas, styled
from .thinning import thinned

POINTS = 1500
"""Number of points drawn of a record."""
APART = 0.022
"""Least distance between the names of two phases, as a share of the duration."""


@styled
def preview(experiment: Experiment) -> Drawing:
    """Two panels against time with the names of the phases, and a panel with the loops.

    Parameters
    ----------
    experiment : Experiment
        The recording after reading.
    """
    figure, axes = canvas(2, 2, 4.2, gridspec_kw={"width_ratios": [2.2, 1.0]})
    (drive, loop), (motion, rest) = axes
    rest.remove()
    data: dict[str, np.ndarray] = {}
    end = experiment[-1].start_time + experiment[-1].duration
    place, apart = -np.inf, APART * (end - experiment[0].start_time)
    for number, record in enumerate(experiment, 1):
        at = thinned(record.displacement, POINTS)
        time, u, y = record.time[at], record.voltage[at], 1e6 * record.displacement[at]
        drive.plot(time, u, **MEASURED)
        motion.plot(time, y, **MEASURED)
        loop.plot(u, y, **MEASURED)
        place = max(float(time[0]), place + apart)
        if place <= end:
            drive.annotate(record.phase, (place, 1.02), xycoords=("data", "axes fraction"), fontsize=7, rotation=90)
        data |= {f"time_s_{number}": time, f"voltage_V_{number}": u, f"displacement_um_{number}": y}
    drive.set_ylabel("drive voltage [V]")
    motion.set_ylabel("displacement [µm]")
    motion.set_xlabel("time since the first sample [s]")
    loop.set_xlabel("drive voltage [V]")
    loop.set_ylabel("displacement [µm]")
    return Drawing(
        "preview",
        "What was understood",
        "Drive voltage and displacement against time, named by phase, and the displacement against the drive voltage. "
        "A displacement that does not follow the voltage points to a wrong column.",
        f"{counted(len(experiment), 'phase')} over {end:.3g} s.",
        figure,
        data,
    )
