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

"""`Agreement`: checks that the measured voltage follows the requested drive, and that the displacement changes."""

from __future__ import annotations

import math

import numpy as np

from ..errors import DeviceError
from .description import Samples


class Agreement:
    """Compares the requested drive with the measurement, block by block.

    The voltages may differ by more than the tolerance while the amplifier settles. A difference of one sign that lasts
    longer shows saturation, exchanged channels, another sample period, a repeated block, or a servo that is switched
    on. A displacement that stays exactly the same while the drive moves is not a measurement.

    Parameters
    ----------
    tolerance : float
        Largest steady difference of the voltages [V].
    settling_samples : int
        Number of consecutive samples for which the difference may be larger, e.g. after a step.
    displacement_min, displacement_max : float
        Range of the sensor [m]. At its ends the signal may be constant, because the sensor is clipped there.
    """

    def __init__(
        self,
        tolerance: float,
        settling_samples: int,
        displacement_min: float = -math.inf,
        displacement_max: float = math.inf,
    ) -> None:
        self._tolerance, self._settling = tolerance, settling_samples
        self._range = displacement_min, displacement_max
        self._seen = 0
        self._side, self._apart = 0.0, 0
        self._value, self._low, self._high = math.nan, math.inf, -math.inf

    def check(self, asked: Samples, voltage: Samples, displacement: Samples) -> None:
        """Compare the next block.

        Parameters
        ----------
        asked, voltage : (n,) ndarray
            Requested and measured drive [V].
        displacement : (n,) ndarray
            Measured displacement [m].

        Raises
        ------
        DeviceError
            If they disagree.
        """
        self._follows(asked, voltage)
        self._moves(voltage, displacement)
        self._seen += voltage.size

    def _follows(self, asked: Samples, voltage: Samples) -> None:
        difference = voltage - asked
        side = np.where(np.abs(difference) > self._tolerance, np.sign(difference), 0.0)
        edges = np.flatnonzero(np.diff(side, prepend=np.nan, append=np.nan))
        for first, end in zip(edges[:-1], edges[1:], strict=True):
            before = self._apart if first == 0 and side[0] == self._side else 0
            if side[first] and before + end - first > self._settling:
                worst = first + int(np.argmax(np.abs(difference[first:end])))
                raise DeviceError(
                    f"measured a drive of {voltage[worst]:g} V at sample {self._seen + worst}, expected "
                    f"{asked[worst]:g} V within {self._tolerance:g} V (since sample {self._seen + first - before}): "
                    "the amplifier is saturated or slower than settling_time, the channels are exchanged, or the "
                    "samples belong to another waveform"
                )
            self._side, self._apart = float(side[first]), before + int(end - first)

    def _moves(self, voltage: Samples, displacement: Samples) -> None:
        last = int(np.flatnonzero(np.diff(displacement, prepend=self._value)).max(initial=-1))
        if last >= 0:
            self._value, self._low, self._high = float(displacement[last]), math.inf, -math.inf
        still = voltage[max(last, 0) :]
        self._low, self._high = min(self._low, float(still.min())), max(self._high, float(still.max()))
        if self._range[0] < self._value < self._range[1] and self._high - self._low > self._tolerance:
            raise DeviceError(
                f"the displacement stayed at exactly {self._value:g} m while the drive moved by "
                f"{self._high - self._low:g} V, expected new readings; check that the sensor is connected"
            )
