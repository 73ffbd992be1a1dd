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

"""Meaning of the error numbers that a controller returns for ``ERR?``."""

STOPPED_BY_COMMAND = 10
"""A motion was stopped by a command."""
UNKNOWN_COMMAND = 2
"""The command is not known."""
SYNTAX = 1
"""The parameters of a command are not well formed."""
OUT_OF_RANGE = 17
"""A parameter is out of range."""
ILLEGAL_AXIS = 23
"""There is no such axis or channel."""
WRONG_COUNT = 24
"""A command has the wrong number of parameters."""
UNKNOWN_PARAMETER = 54
"""There is no such controller parameter."""
NO_RECORDER_TABLE = 57
"""There is no such recorder table."""
NO_RECORD_OPTION = 58
"""There is no such record option."""
READ_ONLY = 64
"""The controller parameter cannot be written."""
VOLTAGE_OUT_OF_LIMITS = 66
"""The voltage is outside the limits."""
WAVE_TOO_LARGE = 67
"""The wave memory is too small."""
GENERATOR_ACTIVE = 73
"""The wave generator is active."""
NO_WAVE_SELECTED = 75
"""No wave table is connected to the generator."""
TOO_FEW_RECORDED = 77
"""The recorder contains fewer samples than requested."""
SERVO_IS_ON = 79
"""An open-loop move was refused because the servo is on."""

MEANING = {
    SYNTAX: "syntax of the parameters",
    UNKNOWN_COMMAND: "the command is not known",
    3: "the command is too long; lower points_per_command",
    5: "the axis may not move: not referenced, or servo off",
    7: "position outside the limits",
    STOPPED_BY_COMMAND: "stopped by a command",
    15: "no such axis",
    OUT_OF_RANGE: "a parameter is out of range",
    ILLEGAL_AXIS: "no such axis or channel",
    WRONG_COUNT: "wrong number of parameters",
    25: "not a number",
    UNKNOWN_PARAMETER: "no such controller parameter",
    NO_RECORDER_TABLE: "no such recorder table",
    NO_RECORD_OPTION: "no such record option",
    60: "the command level is too low for this parameter",
    61: "autozero is running",
    READ_ONLY: "the controller parameter cannot be written",
    VOLTAGE_OUT_OF_LIMITS: "voltage outside the limits",
    WAVE_TOO_LARGE: "the wave memory is too small",
    72: "the axis listens to an analogue input; disconnect that first",
    GENERATOR_ACTIVE: "the wave generator is active",
    NO_WAVE_SELECTED: "no wave table is connected to the generator",
    76: "the input buffer ran over; lower points_per_command",
    TOO_FEW_RECORDED: "the recorder holds fewer samples",
    SERVO_IS_ON: "open-loop moves are refused while the servo is on",
}
"""Meanings of the numbers that can occur here; others are reported as numbers."""


def meaning(number: int) -> str:
    """Error number with its meaning."""
    return f"error {number} ({MEANING.get(number, 'see the manual of the controller')})"
