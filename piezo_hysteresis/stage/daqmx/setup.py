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

"""`DaqmxSetup`: how amplifier and sensor are wired to a card, and their scales."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import StageError
from ...parameter import slew_text
from ..description import Description


@dataclass(frozen=True, slots=True)
class DaqmxSetup:
    """Wiring and scales of one axis.

    Parameters
    ----------
    device : str
        Name of the card, as NI MAX shows it.
    output : str
        Analogue output that drives the amplifier.
    displacement_input : str
        Analogue input of the position sensor.
    voltage_input : str
        Analogue input of the amplifier's monitor; empty if the drive is not measured.
    server : str
        ``host:port`` of an NI gRPC device server; empty for the driver on this machine.
    sample_period : float
        Time between samples [s].
    sample_period_min : float
        Shortest sample period for this card [s].
    lead : float
        Duration of output in the buffer of the card [s], and the time by which a block may be late. The latency of the
        stage is `lead` and `io_delay`, in whole samples.
    voltage_min, voltage_max : float
        Limits of the drive before the amplifier [V].
    max_slew_rate : float
        Steepest drive [V/s], and rate of the ramp to the safe voltage unless a driver sets a lower one; required.
    safe_voltage : float
        Drive voltage of the stage at rest [V].
    assume_safe : bool
        True to take the output to be at its safe voltage at the start, if neither the card nor a monitor can report it.
    amplifier_gain : float
        Piezo voltage over drive voltage [V/V].
    monitor_gain : float
        Voltage at `voltage_input` over piezo voltage [V/V].
    sensor_gain : float
        Displacement over sensor voltage [m/V].
    voltage_tolerance : float
        Largest steady difference between requested and measured piezo voltage [V].
    settling_time : float
        Time that the amplifier needs to follow a step [s].
    sensor_range : float
        The sensor's output and the inputs span ± this voltage [V].
    io_delay : float
        Delay of the card from output to input, measured by `loop_back_delay` [s]. Its whole samples are subtracted, so
        that the remaining delay is that of the stage. Where the drive is measured, only the labels depend on it.
    timeout : float
        Longest wait for samples beyond their own duration, and longest time without an answer of a server [s].

    Raises
    ------
    StageError
        If a value is impossible.
    """

    device: str
    output: str = "ao0"
    displacement_input: str = "ai0"
    voltage_input: str = ""
    server: str = ""
    sample_period: float = 20e-6
    sample_period_min: float = 4e-6
    lead: float = 0.1
    voltage_min: float = 0.0
    voltage_max: float = 10.0
    max_slew_rate: float = 0.0
    safe_voltage: float = 0.0
    assume_safe: bool = False
    amplifier_gain: float = 20.0
    monitor_gain: float = 0.1
    sensor_gain: float = 6e-6
    voltage_tolerance: float = 1.0
    settling_time: float = 0.01
    sensor_range: float = 10.0
    io_delay: float = 0.0
    timeout: float = 5.0

    def __post_init__(self) -> None:
        for name in ("device", "output", "displacement_input"):
            if not getattr(self, name):
                raise StageError(f"nidaqmx.{name}: got no name, expected one as NI MAX shows it")
        for name in (
            "sample_period",
            "sample_period_min",
            "lead",
            "sensor_range",
            "timeout",
            "voltage_tolerance",
        ):
            if not getattr(self, name) > 0:
                raise StageError(f"nidaqmx.{name}: got {getattr(self, name)!r}, expected more than 0")
        if not 0 < self.max_slew_rate < math.inf:
            raise StageError(
                f"nidaqmx.max_slew_rate: got {slew_text(self.max_slew_rate)}, expected the steepest drive that the "
                "amplifier and the stage allow, more than 0 and finite; from the amplifier's current I and the piezo's "
                "capacitance C it is I/C, divided by amplifier_gain"
            )
        for name in ("amplifier_gain", "monitor_gain", "sensor_gain"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) != 0):
                raise StageError(f"nidaqmx.{name}: got {getattr(self, name)!r}, expected a number other than 0")
        if not 0 <= self.io_delay < 1:
            raise StageError(f"nidaqmx.io_delay: got {self.io_delay!r} s, expected 0 to 1 s")

    @property
    def lead_samples(self) -> int:
        """Number of samples in the output buffer."""
        return max(round(self.lead / self.sample_period), 1)

    @property
    def latency_samples(self) -> int:
        """Number of samples between a drive and the reading that shows it: output buffer, and delay of the card."""
        return self.lead_samples + round(self.io_delay / self.sample_period)

    def description(self) -> Description:
        """Limits and scales of the stage, and its latency at this sample period."""
        s = self
        scale = abs(s.sensor_gain) * s.sensor_range
        return Description(
            name=f"NI-DAQmx {s.server or 'local'} {s.device}/{s.output}",
            streaming=True,
            sample_period_min=s.sample_period_min,
            sample_period_max=1.0,
            voltage_min=s.voltage_min,
            voltage_max=s.voltage_max,
            max_slew_rate=s.max_slew_rate,
            safe_voltage=s.safe_voltage,
            amplifier_gain=s.amplifier_gain,
            displacement_min=-scale,
            displacement_max=scale,
            measured_voltage=bool(s.voltage_input),
            latency=s.latency_samples * s.sample_period,
        )
