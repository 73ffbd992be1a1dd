"""What the error numbers mean that a controller keeps for ``ERR?``."""

STOPPED_BY_COMMAND = 10
UNKNOWN_COMMAND = 2
SYNTAX = 1
OUT_OF_RANGE = 17
ILLEGAL_AXIS = 23
WRONG_COUNT = 24
UNKNOWN_PARAMETER = 54
NO_RECORDER_TABLE = 57
NO_RECORD_OPTION = 58
READ_ONLY = 64
VOLTAGE_OUT_OF_LIMITS = 66
WAVE_TOO_LARGE = 67
GENERATOR_ACTIVE = 73
NO_WAVE_SELECTED = 75
TOO_FEW_RECORDED = 77
SERVO_IS_ON = 79

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
"""Numbers that can come up here; every other one is told by its number."""


def meaning(number: int) -> str:
    """Error number with what it means."""
    return f"error {number} ({MEANING.get(number, 'see the manual of the controller')})"
