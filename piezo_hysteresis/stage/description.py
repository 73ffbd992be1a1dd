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

"""`Description`: kind, limits and scales of a stage, and the check of these limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import StageError, printable
from ..parameter import slew_text

Samples = NDArray[np.float64]

_PERIOD_TOLERANCE = 1e-6
"""Relative difference up to which two sample periods count as equal."""


@dataclass(frozen=True, slots=True)
class Description:
    """Kind, limits and scales of a stage.

    Parameters
    ----------
    name : str
        Model and serial number, or name of the simulation; unique per device, so that a driver can lock it. Characters
        that cannot be printed are replaced by their escapes.
    streaming : bool
        True for a `StreamingStage`, False for a `MemoryStage`.
    sample_period_min, sample_period_max : float
        Shortest and longest sample period [s].
    sample_period_step : float
        Sample periods are whole multiples of it [s]; 0 if any period in the range is possible.
    voltage_min, voltage_max : float
        Drive limits before the amplifier [V].
    max_slew_rate : float
        Steepest drive that is accepted [V/s]; infinite if a step within one sample is harmless.
    safe_voltage : float
        Drive voltage of the stage at rest [V].
    longest_block : int, optional
        Largest number of samples in a block; None if there is no limit.
    amplifier_gain : float
        Piezo voltage over drive voltage [V/V].
    displacement_min, displacement_max : float
        Sensor range [m]; samples at its ends are clipped.
    measured_voltage : bool
        True if the returned voltage is measured, False if it is the commanded one.
    latency : float
        Delay of the answers of a streaming stage [s]: sample i of an answer was applied and measured that long before
        sample i of the given drive will be applied; 0 if they are the same sample. A stage with latency has its own
        clock, and `exchange` returns when that clock has produced the samples.
    ignores_drive : bool
        True for a replayed recording, which does not play the requested drive.

    Raises
    ------
    StageError
        If a minimum lies above its maximum, the safe voltage lies outside the limits, or another value is impossible.
    """

    name: str
    streaming: bool
    sample_period_min: float
    sample_period_max: float
    voltage_min: float
    voltage_max: float
    sample_period_step: float = 0.0
    max_slew_rate: float = math.inf
    safe_voltage: float = 0.0
    longest_block: int | None = None
    amplifier_gain: float = 1.0
    displacement_min: float = -math.inf
    displacement_max: float = math.inf
    measured_voltage: bool = False
    latency: float = 0.0
    ignores_drive: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", printable(self.name))
        for low, high in (
            ("sample_period_min", "sample_period_max"),
            ("voltage_min", "safe_voltage"),
            ("safe_voltage", "voltage_max"),
            ("displacement_min", "displacement_max"),
        ):
            if not getattr(self, low) <= getattr(self, high):
                raise StageError(
                    f"{self.name}: got {low} {getattr(self, low):g} above {high} {getattr(self, high):g}, "
                    "expected ordered limits"
                )
        if not 0 <= self.latency < math.inf:
            raise StageError(f"{self.name}: got latency {self.latency:g} s, expected 0 or more")
        if not (self.sample_period_min > 0 and self.max_slew_rate > 0 and self.amplifier_gain != 0):
            raise StageError(
                f"{self.name}: got sample period {self.sample_period_min:g} s, slew rate {self.max_slew_rate:g} V/s "
                f"and gain {self.amplifier_gain:g}, expected a positive period and rate and a gain other than zero"
            )

    def check_sample_period(self, sample_period: float) -> float:
        """Return `sample_period` [s] if the stage can run at it.

        Raises
        ------
        StageError
            If it is outside the range, or no whole multiple of `sample_period_step`.
        """
        low, high, step = self.sample_period_min, self.sample_period_max, self.sample_period_step
        inside = low * (1 - _PERIOD_TOLERANCE) <= sample_period <= high * (1 + _PERIOD_TOLERANCE)
        if not inside:
            raise StageError(f"{self.name}: got sample period {sample_period:g} s, expected {low:g} to {high:g} s")
        multiple = sample_period / step if step > 0 else 0.0
        if abs(multiple - round(multiple)) > _PERIOD_TOLERANCE * multiple:
            raise StageError(
                f"{self.name}: got sample period {sample_period:g} s, expected a whole multiple of {step:g} s"
            )
        return float(sample_period)

    def check_voltage(self, voltage: ArrayLike, present_voltage: float, sample_period: float) -> Samples:
        """Return `voltage` as a contiguous array if the stage may play it. This is the last check before the device.

        Parameters
        ----------
        voltage : (n,) array_like
            Drive voltage [V].
        present_voltage : float
            Voltage applied before the first sample [V]; the slew of the first sample counts from it.
        sample_period : float
            Time between samples [s].

        Returns
        -------
        (n,) ndarray of float64

        Raises
        ------
        StageError
            If the shape is wrong, the block is too long, or samples are not finite, outside the limits or too steep.
        """
        try:
            block = np.ascontiguousarray(voltage, dtype=np.float64)
        except (TypeError, ValueError):
            kind = type(voltage).__name__
            raise StageError(f"{self.name}: got {kind} as drive, expected an array of volts") from None
        if block.ndim != 1 or block.size == 0:
            raise StageError(f"{self.name}: got drive of shape {block.shape}, expected one dimension, not empty")
        if self.longest_block is not None and block.size > self.longest_block:
            raise StageError(
                f"{self.name}: got {block.size} samples, expected at most {self.longest_block} per block; "
                "cut the waveform"
            )
        inside = (block >= self.voltage_min) & (block <= self.voltage_max)
        if not inside.all():
            first = int(np.argmin(inside))
            raise StageError(
                f"{self.name}: drive sample {first} is {float(block[first])} V, expected {self.voltage_min:g} to "
                f"{self.voltage_max:g} V; nothing was played"
            )
        if math.isfinite(self.max_slew_rate):
            steepest = self.max_slew_rate * sample_period
            step = np.abs(np.diff(block, prepend=present_voltage))
            too_steep = step > steepest * (1 + 1e-9) + 1e-12
            if too_steep.any():
                first = int(np.argmax(too_steep))
                start, remedy = "", "make the drive slower"
                if first == 0:
                    start = f" from the present voltage of {present_voltage:.9g} V"
                    remedy = f"move the stage to {block[0]:.9g} V first, e.g. by `set_voltage`"
                raise StageError(
                    f"{self.name}: drive sample {first} steps by {step[first]:.9g} V{start}, expected at most "
                    f"{steepest:g} V per sample ({slew_text(self.max_slew_rate)}); nothing was played; {remedy}"
                )
        return block
