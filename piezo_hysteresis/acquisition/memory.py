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

"""`MemoryAcquisition`: drives a stage with on-board memory by blocks that are uploaded, run and read. No ROS."""

from __future__ import annotations

import time
from typing import cast

import numpy as np

from ..errors import StageError, StoppedError
from ..stage.stage import Acquired, MemoryStage
from .playback import Playback
from .streaming import StreamingAcquisition


class MemoryAcquisition(StreamingAcquisition):
    """As `StreamingAcquisition`, for a `MemoryStage`.

    Waveforms and ramps are uploaded in blocks as long as the memory. While a voltage is held, single samples are read.
    The index follows the clock, so that it jumps over the time in which nothing was measured; such a block is marked by
    `SampleBlock.follows_gap`.

    The device plays a block to its end unless it is stopped. A ramp to a set-point that arrives meanwhile begins at the
    end of the block; a waveform that arrives meanwhile is refused.
    """

    rest_period = 0.02
    """Time between readings while a voltage is held [s]."""
    _poll = 0.01
    _given = False
    _next_target: float | None = None

    def ramp_to(self, voltage: float) -> None:
        """See `Playback.ramp_to`; while the device plays a block, the ramp begins at the end of that block."""
        with self._access:
            self._latch.require_released("set_voltage")
            self.playback.require_free("set_voltage")
            if self._given:
                self._next_target = voltage
            else:
                self.playback.ramp_to(voltage)

    def _require_free(self, name: str) -> None:
        super()._require_free(name)
        if self._given:
            raise StageError(f"{name}: the stage is on its way to another voltage; wait until it is there")

    def _run(self) -> None:
        cast(MemoryStage, self.stage).watch(self._is_interrupted)
        super()._run()

    def _is_interrupted(self) -> bool:
        self.keeper.begin_step()
        return self.playback.is_stopping or self.keeper.is_lost

    def _step(self) -> None:
        playback = cast(Playback, self.playback)
        with self._access:
            pending, is_stopping = playback.pending, playback.is_stopping
        if is_stopping:
            self._break_off(playback)
        elif pending:
            self._play(playback, min(pending, self.stage.description.longest_block or pending))
        else:
            self._rest(playback)

    def _rest(self, playback: Playback) -> None:
        due = time.monotonic() + self.rest_period
        while time.monotonic() < due:
            if not self._wait_until(min(due, time.monotonic() + self._poll)):
                return
            if playback.pending or playback.is_stopping:
                return
        self._look(playback)

    def _look(self, playback: Playback) -> None:
        """Read one sample while a voltage is held."""
        voltage, displacement = self.stage.read_voltage(), self.stage.read_displacement()
        first = max(self._time_base.index_at(time.monotonic()), self.index)
        with self._access:
            if playback.pending:
                return
            playback.pass_unseen(first - self.index)
            drive = playback.take(1)
        self._pass_on(first, drive, Acquired(np.array([voltage]), np.array([displacement])))

    def _play(self, playback: Playback, count: int) -> None:
        """Upload, run and read one block; a stop takes effect between any two messages to the device."""
        stage = cast(MemoryStage, self.stage)
        with self._access:
            voltage = playback.preview(count).voltage
            self._given = True
        try:
            stage.upload(voltage)
            stage.arm()
            first = max(self._time_base.index_at(time.monotonic()), self.index)
            stage.start()
            end = self._time_base.due(first + count)
            while (now := time.monotonic()) < end and not self._is_interrupted():
                if not self._wait_until(min(end, now + self._poll)):
                    break
            if time.monotonic() < end:
                self._break_off(playback)
                return
            stage.wait(1.0 + end - self._time_base.due(first))
            acquired = stage.read()
        except StoppedError:
            self._break_off(playback)
            return
        with self._access:
            drive = None if self._is_interrupted() else playback.take(count)
            if drive is not None:
                self._continue(playback)
        if drive is None:
            self._break_off(playback)
        else:
            self._pass_on(first, drive, acquired)

    def _continue(self, playback: Playback) -> None:
        """After a block, begin the ramp to a set-point that arrived meanwhile, if any."""
        target, self._next_target, self._given = self._next_target, None, False
        if target is not None:
            playback.ramp_to(target)

    def _break_off(self, playback: Playback) -> None:
        """Let the device go to its safe voltage by itself; the samples of this ramp are not read."""
        self._go_safe()
        self.keeper.require()
        with self._access:
            playback.jump(self.stage.description.safe_voltage)
            self._next_target, self._given = None, False
        self._look(playback)
