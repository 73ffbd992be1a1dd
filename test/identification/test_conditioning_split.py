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


from dataclasses import replace

import numpy as np

from piezo_hysteresis.identification.records.conditioning_split import known_from_within
from piezo_hysteresis.record import Experiment, Record

TIME = 1e-3 * np.arange(6000)
DRIVE = 5.0 + np.where(TIME < 2.0, 2.0 * TIME, 4.0) * np.sin(2.0 * np.pi * TIME)


def record(voltage, phase, start=0.0, **fields):
    return Record(voltage, voltage, 1e-3, phase, start, **fields)


def phases(**fields):
    """The amplitude grows during the first one, and the third one is smaller."""
    whole = record(DRIVE, "growing", **fields)
    parts = whole.split(2000, 4000)
    return [replace(part, phase=phase) for part, phase in zip(parts, ("growing", "large", "last"), strict=True)]


def test_a_loop_in_a_phase_makes_the_following_ones_known():
    found, notices = known_from_within(Experiment(tuple(phases(truncated=True))))
    assert [(r.phase, r.truncated) for r in found] == [
        ("growing", True),
        ("conditioning", True),
        ("large", False),
        ("last", False),
    ]
    (unused,) = [n for n in notices if n.kind == "not_used"]
    assert unused.message.startswith("1 of 3 phases, 38 % of the samples, were not used")
    assert unused.message.endswith(": growing") and not unused.severe


def test_a_gap_between_the_phases_loses_the_state_again():
    _, large, last = phases(truncated=True)
    short = replace(last[:300], start_time=last.start_time + 0.5)
    found, _ = known_from_within(Experiment((large, short)))
    assert found[len(found) - 1].truncated


def test_the_loss_of_most_samples_is_severe():
    known = record(np.full(500, 5.0) + np.arange(500) / 100.0, "ramp")
    lost = record(DRIVE[:1900], "growing", 5.0, truncated=True, continues=True)
    _, notices = known_from_within(Experiment((known, lost)))
    (unused,) = [n for n in notices if n.kind == "not_used"]
    assert unused.severe and "1 of 2 phases, 79 % of the samples" in unused.message


def test_nothing_is_reported_where_nothing_else_moves():
    """Then the records of unknown state are used."""
    rest = record(np.zeros(500), "rest")
    lost = record(DRIVE[:1900], "growing", 5.0, truncated=True, continues=True)
    _, notices = known_from_within(Experiment((rest, lost)))
    assert not notices
