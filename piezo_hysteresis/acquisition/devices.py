"""Real controllers: their ROS parameters, and how a stage is opened from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..parameter import Parameter, Row, Setting
from ..stage.daqmx.setup import DaqmxSetup
from ..stage.daqmx.stage import DaqmxStage
from ..stage.gcs2.setup import Gcs2Setup
from ..stage.gcs2.stage import Gcs2Stage
from ..stage.stage import Stage

_UNVERIFIED = "not verified on a device: docs/hardware.md"
"""Remark on parameters that no device has confirmed yet."""
_GCS2, _DAQMX = Gcs2Setup(host="-"), DaqmxSetup(device="-")
"""Set-ups whose values are the defaults."""

GCS2: tuple[Row, ...] = (
    Setting("host", "", "name or address of the controller"),
    Setting("port", _GCS2.port, "TCP port", lower=1, upper=65535),
    Setting("axis", _GCS2.axis, "axis identifier"),
    Setting("channel", _GCS2.channel, "output channel of the piezo", lower=1, upper=1000),
    Setting("generator", _GCS2.generator, "wave generator of the axis", lower=1, upper=1000),
    Setting("wave_table", _GCS2.wave_table, "wave table that is overwritten", lower=1, upper=100_000),
    Setting("voltage_table", _GCS2.voltage_table, "recorder table of the piezo voltage", lower=1, upper=1000),
    Setting("displacement_table", _GCS2.displacement_table, "recorder table of the position", lower=1, upper=1000),
    Setting(
        "voltage_option",
        _GCS2.voltage_option,
        f"record option of the piezo voltage; {_UNVERIFIED}",
        lower=0,
        upper=100_000,
    ),
    Setting("displacement_option", _GCS2.displacement_option, "record option of the position", lower=0, upper=100_000),
    Setting(
        "servo_time_parameter",
        _GCS2.servo_time_parameter,
        f"number of the servo time; {_UNVERIFIED}",
        lower=0,
        upper=2**32 - 1,
    ),
    Setting(
        "recorder_parameter",
        _GCS2.recorder_parameter,
        f"number of the recorder's points; {_UNVERIFIED}",
        lower=0,
        upper=2**32 - 1,
    ),
    Setting(
        "points_per_command", _GCS2.points_per_command, f"wave points in one line; {_UNVERIFIED}", lower=1, upper=10_000
    ),
    Setting("rows_per_answer", _GCS2.rows_per_answer, "recorded samples asked for at once", lower=1, upper=2**20),
    Setting("read_back", _GCS2.read_back, "compare the wave table with what was sent before anything moves"),
    Setting(
        "longest_wave",
        _GCS2.longest_wave,
        f"points of the wave table; 0: ask the controller; {_UNVERIFIED}",
        lower=0,
        upper=2**31 - 1,
    ),
    Setting(
        "longest_multiple",
        _GCS2.longest_multiple,
        f"largest sample period in servo times; {_UNVERIFIED}",
        lower=1,
        upper=2**31 - 1,
    ),
    Parameter(
        "amplifier_gain", "G_a", "V/V", 1.0, -1e4, 1e4, "piezo voltage over drive voltage; 1: drive = piezo", "rig"
    ),
    Parameter(
        "command_per_volt", "c", "1/V", 1.0, -1e3, 1e3, f"open-loop command over piezo voltage; {_UNVERIFIED}", "rig"
    ),
    Parameter("command_at_zero", "c_0", "1", 0.0, -1e4, 1e4, f"open-loop command at 0 V; {_UNVERIFIED}", "rig"),
    Parameter("position_unit", "", "m", 1e-6, 1e-12, 1.0, "length of one unit of POS?", "manual of the controller"),
    Parameter("safe_voltage", "u_s", "V", 0.0, -1e4, 1e4, "drive voltage of the stage at rest", "rig"),
    Parameter("max_slew_rate", "S", "V/s", 0.0, 0.0, 1e12, "steepest drive; 0: no limit but the amplifier's", "rig"),
    Parameter("voltage_tolerance", "", "V", 1.0, 1e-3, 1e3, "largest steady error of the piezo voltage", "rig"),
    Parameter("settling_time", "", "s", 0.01, 0.0, 10.0, "time the piezo voltage needs to follow a step", "rig"),
    Parameter("timeout", "", "s", 2.0, 0.01, 600.0, "longest silence of the controller", "network"),
)
"""Of a stage on a controller that speaks GCS 2.0."""

NIDAQMX: tuple[Row, ...] = (
    Setting("device", "", "name of the card, as NI MAX shows it"),
    Setting("output", _DAQMX.output, "analogue output that drives the amplifier"),
    Setting("displacement_input", _DAQMX.displacement_input, "analogue input of the position sensor"),
    Setting("voltage_input", _DAQMX.voltage_input, "analogue input of the amplifier's monitor; empty: none"),
    Setting("server", _DAQMX.server, "host:port of an NI gRPC device server; empty: the driver on this machine"),
    Parameter("sample_period_min", "", "s", _DAQMX.sample_period_min, 1e-9, 1.0, "shortest sample period", "the card"),
    Parameter("lead", "", "s", _DAQMX.lead, 1e-3, 10.0, "output that waits in the buffer: the latency", "the machine"),
    Parameter("voltage_min", "u_min", "V", _DAQMX.voltage_min, -10.0, 10.0, "lowest drive voltage", "rig"),
    Parameter("voltage_max", "u_max", "V", _DAQMX.voltage_max, -10.0, 10.0, "highest drive voltage", "rig"),
    Parameter("max_slew_rate", "S", "V/s", 0.0, 0.0, 1e12, "steepest drive; 0: no limit but the amplifier's", "rig"),
    Parameter("safe_voltage", "u_s", "V", 0.0, -10.0, 10.0, "drive voltage of the stage at rest", "rig"),
    Parameter(
        "amplifier_gain", "G_a", "V/V", _DAQMX.amplifier_gain, -1e4, 1e4, "piezo voltage over drive voltage", "rig"
    ),
    Parameter("monitor_gain", "", "V/V", _DAQMX.monitor_gain, -1e3, 1e3, "monitor voltage over piezo voltage", "rig"),
    Parameter("sensor_gain", "", "m/V", _DAQMX.sensor_gain, -1.0, 1.0, "displacement over sensor voltage", "rig"),
    Parameter("voltage_tolerance", "", "V", 1.0, 1e-3, 1e3, "largest steady error of the piezo voltage", "rig"),
    Parameter("settling_time", "", "s", 0.01, 0.0, 10.0, "time the amplifier needs to follow a step", "rig"),
    Parameter("sensor_range", "", "V", _DAQMX.sensor_range, 1e-3, 10.0, "the inputs span ± this voltage", "the card"),
    Parameter("io_delay", "", "s", 0.0, 0.0, 1.0, "delay of the card itself, from a loop-back", "loop_back_delay"),
    Parameter(
        "timeout", "", "s", _DAQMX.timeout, 0.01, 600.0, "longest wait for samples, silence of a server", "network"
    ),
)
"""Of a stage on a National Instruments card."""


def open_gcs2(values: Mapping[str, Any], _: float) -> Stage:
    """Connect to a GCS 2.0 controller; StageError if it is not there or not what the values say."""
    slew = values["max_slew_rate"] or math.inf
    return Gcs2Stage(Gcs2Setup(**{**values, "max_slew_rate": slew}))


def open_nidaqmx(values: Mapping[str, Any], sample_period: float) -> Stage:
    """Open a stage on a National Instruments card; StageError if it is not there or not what the values say."""
    slew = values["max_slew_rate"] or math.inf
    period = {"sample_period": sample_period} if sample_period else {}
    return DaqmxStage(DaqmxSetup(**{**values, "max_slew_rate": slew, **period}))
