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

"""`FAULTS`: faults of an emulated card and its server."""

from __future__ import annotations

from ..fault import FaultCatalogue

_IN_A_STREAM = "ReadAnalogF64:5"
"""Call at which a fault begins by default: the second block of a stream, of a card that reads its output back."""

FAULTS = FaultCatalogue(
    once={
        "link_lost": (_IN_A_STREAM, "the server cannot be reached for one call"),
        "gone": (_IN_A_STREAM, "the server cannot be reached from then on"),
        "slow": (_IN_A_STREAM, "the answer is late, by the number of seconds given after '=' (5)"),
        "error": (_IN_A_STREAM, "refused with the NI-DAQmx error number given after '=' (-50103)"),
        "device_lost": (_IN_A_STREAM, "the card is unplugged for one call"),
        "underflow": (_IN_A_STREAM, "the output buffer runs empty"),
        "late": (_IN_A_STREAM, "the samples are not available within the time-out of the read"),
        "short_read": (_IN_A_STREAM, "one sample less than requested is returned"),
        "duplicated": (_IN_A_STREAM, "the samples of the previous read are returned again"),
        "garbled": (_IN_A_STREAM, "one sample is not a number"),
    },
    lasting={
        "wrong_clock": "samples at half the requested rate, and reports that rate",
        "saturated": "the amplifier saturates at half of the voltage range",
        "stale": "the readings of the sensor do not change",
        "swapped": "the inputs of sensor and monitor are exchanged",
        "skewed": "the sensor is read one sample late",
    },
    values={"slow": 5.0, "error": -50103.0},
)
"""Faults of the emulated card, with the call at which each begins."""
