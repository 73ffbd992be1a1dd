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

"""Simulated stages of both kinds: `SimulatedStage` streams, `SimulatedMemoryStage` plays from its own memory."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from ...errors import StageError, StoppedError
from ..plant import PlantParameters
from ..stage import Acquired, Samples
from .simulation import Simulation


class SimulatedStage(Simulation):
    """A simulated stage that streams.

    Simulated time passes only while samples are taken; the caller paces the blocks for real time.

    Parameters
    ----------
    parameters : PlantParameters, optional
        Physics; default the stage of the paper with nothing hidden.
    seed : int
        Fixes the noise and every random phase.
    sample_period : float
        Time between samples [s], 1 µs to 10 ms.

    Examples
    --------
    >>> stage = SimulatedStage(seed=1)
    >>> record = stage.play([0.0] * 100 + [3.0] * 100, phase="step")
    >>> record.size, record.phase
    (200, 'step')
    """

    def __init__(
        self, parameters: PlantParameters | None = None, *, seed: int = 0, sample_period: float = 20e-6
    ) -> None:
        super().__init__(parameters, seed=seed, sample_period=sample_period, streaming=True)

    def exchange(self, voltage: Samples) -> Acquired:
        """Apply a block of drive voltages [V] and return what was applied and measured, sample by sample."""
        return Acquired(*self._run(voltage))


class SimulatedMemoryStage(Simulation):
    """A simulated stage with on-board memory: upload, arm, start, wait, read.

    Between two waveforms the plant holds its voltage for `dead_time` of simulated time.

    Parameters
    ----------
    parameters, seed, sample_period
        As for `SimulatedStage`.
    longest_block : int
        Samples that the memory holds.
    dead_time : float
        Simulated time that arming takes [s].
    real_time_factor : float
        Speed at which a waveform plays: 1 is real time; infinite as fast as the machine can.
    """

    def __init__(
        self,
        parameters: PlantParameters | None = None,
        *,
        seed: int = 0,
        sample_period: float = 20e-6,
        longest_block: int = 32768,
        dead_time: float = 0.05,
        real_time_factor: float = math.inf,
    ) -> None:
        if not (longest_block >= 1 and dead_time >= 0 and real_time_factor > 0):
            raise StageError(
                f"memory stage: got longest_block {longest_block}, dead_time {dead_time:g} s, real_time_factor "
                f"{real_time_factor:g}, expected at least 1 sample, no negative time and a positive factor"
            )
        super().__init__(
            parameters, seed=seed, sample_period=sample_period, streaming=False, longest_block=longest_block
        )
        self._dead_time, self._factor = dead_time, real_time_factor
        self._waveform: Samples | None = None
        self._acquired: Acquired | None = None
        self._armed, self._playing = False, False
        self._begin = 0.0
        self._is_interrupted: Callable[[], bool] = bool

    def watch(self, is_interrupted: Callable[[], bool]) -> None:
        """Call `is_interrupted` before a waveform is stored, armed, started or read; StoppedError once it is true."""
        self._is_interrupted = is_interrupted

    def upload(self, voltage: Samples) -> None:
        """Store a waveform [V]."""
        self._require_ready()
        self._require_not_interrupted()
        self._waveform = self._check(voltage, self.voltage).copy()
        self._armed = False

    def arm(self) -> None:
        """Prepare the start; takes `dead_time` of simulated time at the present voltage."""
        self._require_ready()
        self._require_not_interrupted()
        self._check(self._uploaded(), self.voltage)
        idle = round(self._dead_time / self._sample_period)
        if idle:
            self._apply(np.full(idle, self.voltage))
        self._acquired, self._armed = None, True

    def start(self) -> None:
        """Play and record the waveform."""
        self._require_ready()
        if not self._armed:
            raise StageError(f"{self._description.name}: started without being armed, expected arm() first")
        self._require_not_interrupted()
        self._armed, self._playing, self._begin = False, True, time.monotonic()

    def wait(self, timeout: float) -> None:
        """Return when the waveform has been played; StageError after `timeout` [s]."""
        left = self._left() if self._playing else 0.0
        time.sleep(min(left, max(timeout, 0.0)))
        if left > timeout:
            raise StageError(
                f"{self._description.name}: still playing after {timeout:g} s, expected {left:.3g} s; wait again"
            )
        self._require_ready()
        if self._acquired is None:
            raise StageError(f"{self._description.name}: nothing to wait for, expected start() first")

    def read(self) -> Acquired:
        """The record of the waveform that was played."""
        self._require_ready()
        self._require_not_interrupted()
        if self._acquired is None:
            raise StageError(f"{self._description.name}: nothing recorded, expected upload, arm, start, wait first")
        return self._acquired

    def configure(self, sample_period: float) -> None:
        """Set another sample period [s]; a waveform in memory is discarded."""
        super().configure(sample_period)
        self._waveform, self._acquired, self._armed = None, None, False

    def safe(self) -> None:
        """Stop a waveform that is playing and go to the safe voltage at the ramp rate."""
        self._armed = False
        if self._playing:
            waveform = self._uploaded()
            share = 1 - self._left() * self._factor / (waveform.size * self._sample_period) if self._left() else 1.0
            played = waveform[: int(share * waveform.size)]
            if played.size:
                self._apply(played)
            self._playing = False
        super().safe()

    def _require_not_interrupted(self) -> None:
        if self._is_interrupted():
            raise StoppedError(f"{self._description.name}: stopped before the waveform was played and read")

    def _uploaded(self) -> Samples:
        if self._waveform is None:
            raise StageError(f"{self._description.name}: holds no waveform, expected upload() first")
        return self._waveform

    def _left(self) -> float:
        """Time until the waveform has been played [s]."""
        duration = self._uploaded().size * self._sample_period / self._factor
        return max(self._begin + duration - time.monotonic(), 0.0)

    def _require_ready(self) -> None:
        super()._require_ready()
        if not self._playing:
            return
        if self._left() > 0.0:
            raise StageError(f"{self._description.name}: is still playing, expected wait() first")
        self._acquired, self._playing = Acquired(*self._apply(self._uploaded())), False
