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

"""`FAULTS`: faults of an emulated controller."""

from __future__ import annotations

from ..fault import FaultCatalogue

FAULTS = FaultCatalogue(
    once={
        "link_lost": ("DRR?", "half the answer, then the link is closed"),
        "reset": ("DRR?", "half the answer, then the link is reset"),
        "gone": ("DRR?", "half the answer, then the link is closed and no new link is accepted"),
        "partial_answer": ("DRR?", "half the answer, then nothing more"),
        "slow": ("POS?", "the answer is late, by the number of seconds given after '=' (5)"),
        "trickle": ("POS?", "the answer is sent byte by byte, at intervals of the seconds given after '=' (0.5)"),
        "absurd": ("POS?", "the last number of the answer is the one given after '=' (1e300)"),
        "error": ("WAV", "refused with the error number given after '=' (17)"),
        "garbled": ("DRR?", "one value of the answer is not a number"),
    },
    lasting={
        "short_record": "the recorder stops at four fifths of its waveform",
        "wrong_servo_time": "runs at twice the servo time that SPA? reports",
        "saturated": "the amplifier saturates at half of the voltage range",
        "stale": "the position readings do not change",
        "duplicated": "a block of recorded samples is returned twice",
        "swapped": "the recorded channels are exchanged",
        "skewed": "recorded positions are one sample late",
        "servo_on": "the servo is on and cannot be switched off",
    },
    values={"slow": 5.0, "trickle": 0.5, "absurd": 1e300, "error": 17.0},
)
"""Faults of the emulated controller, with the command at which each begins."""
