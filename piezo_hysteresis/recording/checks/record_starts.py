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

"""`checked_starts`: checks and completes the initial conditions of the records of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import RecordingError
from ...record import Experiment, Notice
from ..segmentation.phases import steps_named
from ..table.read_options import ReadOptions
from .initial_condition_check import departures, is_within_its_loop, steps_from
from .quality import VOLTAGE_RANGE

_WITHIN = "begins on a branch of its loop: earlier motion is not recorded; a settled stage needs `initial_voltage`"
"""Message about a record that begins in motion on its loop."""
_CONTINUES = (
    "continues a phase that was not read: its initial state is unknown, and a simulation begins with an error; read "
    "the whole experiment"
)
"""Message about a first record that continues a missing record."""
_IN_MOTION = "{phases}: the first sample lies on a ramp from {levels}; the stage is assumed to have settled there"
"""Message about records that begin on a ramp."""
_STEP_BEFORE = (
    "{phases}: the displacement jumps although the drive is held from the first sample on; a step from {levels}, where "
    "the stage had settled, is assumed; otherwise give `initial_voltage`"
)
"""Message about records that begin after a step."""
_INFERRED = (("in_motion", _IN_MOTION, departures), ("step_before", _STEP_BEFORE, steps_from))
"""Notices of levels at which a stage had settled, their messages, and where the levels come from."""


def checked_starts(experiment: Experiment, options: ReadOptions) -> Experiment:
    """The experiment with the initial state of every record, as far as options, file and samples determine it.

    Parameters
    ----------
    experiment : Experiment
        As a format read it.
    options : ReadOptions
        Its `initial_voltage` has priority over what the samples suggest.

    Raises
    ------
    RecordingError
        If an initial voltage is larger than that of any piezo stage, and larger than all recorded ones.
    """
    records = experiment.records
    more_notices = []
    if records[0].continues:  # the record that it continues is missing
        records = (replace(records[0], continues=False, truncated=True), *records[1:])
        experiment = experiment.noting(Notice("truncated", _CONTINUES, records[0].phase))
    if options.initial_voltage is not None:
        settled = options.initial_voltage
        records = tuple(r if r.continues or r.truncated else replace(r, initial_voltage=settled) for r in records)
    most = max(VOLTAGE_RANGE[1], *(float(np.abs(r.voltage).max()) for r in records))
    if strange := [r.initial_voltage for r in records if abs(r.initial_voltage or 0.0) > most]:
        said = f"got an initial voltage of {strange[0]:g} V, expected {-most:g} to {most:g} V"
        raise RecordingError(f"{said}; give it by `initial_voltage`")
    midway = {i for i, r in enumerate(records) if is_within_its_loop(r)}
    more_notices += [Notice("truncated", _WITHIN, records[i].phase) for i in sorted(midway)]
    records = tuple(replace(r, truncated=True) if i in midway else r for i, r in enumerate(records))
    levels: dict[str, dict[int, float]] = {}
    for kind, _, inferred in _INFERRED:
        levels[kind] = came_from = inferred(replace(experiment, records=records))
        records = tuple(replace(r, initial_voltage=came_from.get(i, r.initial_voltage)) for i, r in enumerate(records))
    experiment = steps_named(replace(experiment, records=records))
    for kind, message, _ in _INFERRED:
        if came_from := levels[kind]:
            phases = ", ".join(dict.fromkeys(experiment[i].phase for i in came_from))
            voltages = " or ".join(f"{v:.4g} V" for v in sorted(set(came_from.values())))
            more_notices.append(Notice(kind, message.format(phases=phases, levels=voltages)))
    return experiment.noting(*more_notices)
