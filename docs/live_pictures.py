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

"""Picture of a live diagnosis for docs/gap.md: ``python docs/pictures.py live``, about two minutes.

The simulated stage drifts. The finder drives it, phase by phase, until it is sure. The probabilities are drawn and
printed.
"""

from __future__ import annotations

from pathlib import Path

from piezo_hysteresis.discrepancy.choice.live_diagnosis import LiveDiagnosis, begin
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.diagnosis.probabilities import probabilities
from piezo_hysteresis.stage.hidden import hidden_effect
from piezo_hysteresis.stage.simulated import SimulatedStage

HIDDEN, SIZE = "thermal_drift", 5
"""What the stage does besides, and the seed of its size."""


def live_example() -> LiveDiagnosis:
    """Drive the stage until the answer is sure."""
    stage = SimulatedStage(hidden_effect(SIZE, name=HIDDEN).parameters, seed=1)
    live, records = begin(DriveLimits()), list[Record]()
    while live.due:
        for p in live.due:
            records.append(stage.play(p.voltage, p.name, continues=bool(records), average=p.stored_every))
        live = live.advanced(Experiment(tuple(records)))
        print(f"{live.time:.1f} s, {live.updates[-1].played}: {live.updates[-1].sentence()}")
    return live


def draw_live(images: Path) -> None:
    """Draw ``gap_live.png`` and print the decisions."""
    live = live_example()
    print(live.reason())
    probabilities(live.answer()).save_picture(images / "gap_live.png")
