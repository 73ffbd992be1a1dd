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

"""`Witness`: a stage that refuses what it should not be given, keeps what it was given, and can fail."""

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.stage import Acquired, Description


class Witness:
    """A streaming stage whose displacement is its voltage."""

    def __init__(self, sample_period, max_slew_rate, *, fails_at=None, unsafe=False):
        self.description = Description(
            "witness", True, sample_period, sample_period, 0.0, 10.0, max_slew_rate=max_slew_rate
        )
        self.sample_period = sample_period
        self.voltage = 0.0
        self.made_safe = self.closed = 0
        self._fails_at, self._unsafe, self._calls = fails_at, unsafe, 0

    def configure(self, sample_period):
        self.description.check_sample_period(sample_period)

    def restrict(self, limits, ramp_rate):
        self.restricted = limits, ramp_rate

    def exchange(self, voltage):
        self._calls += 1
        if self._calls == self._fails_at:
            raise StageError("witness: link lost")
        block = self.description.check_voltage(voltage, self.voltage, self.sample_period)
        self.voltage = float(block[-1])
        return Acquired(block, block)

    def safe(self):
        self.made_safe += 1
        if self._unsafe:
            raise StageError("witness: no link")
        self.voltage = 0.0

    def close(self):
        self.closed += 1
