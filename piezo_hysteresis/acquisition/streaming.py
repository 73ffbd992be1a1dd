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

"""`StreamingAcquisition`: the thread that exchanges blocks with a streaming stage at the pace of the steady clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import cast

from ..errors import PiezoError, StageError
from ..stage.stage import Acquired, Samples, Stage, StreamingStage
from .device_clock import DeviceClock
from .drive import Drive, OpenCommands, Phase
from .latency_buffer import LatencyBuffer
from .recorded_playback import Source
from .safety.keeper_link import KeeperLink, NoKeeper
from .safety.stop_latch import StopLatch
from .sample_block import Delivery, SampleBlock, Tally
from .time_base import TimeBase, read_together


class StreamingAcquisition:
    """Exchanges blocks with a stage, one after the other, in its own thread.

    Parameters
    ----------
    stage : Stage
        Configured stage. Only this thread calls it while it runs.
    playback : Playback or RecordedPlayback
        Source of the voltages.
    time_base : TimeBase
        Times and stamps of the samples.
    block_size : int
        Number of samples per block.
    node_clock : callable
        The clock of the stamps [ns].
    deliver : callable
        Function that takes every `Delivery`; called in the thread.
    fail : callable
        Called with the PiezoError that ended the thread, after the attempt to bring the stage to its safe voltage.
    ready : callable, optional
        The first block waits until this function returns True.
    latch : StopLatch, optional
        Latch that `stop` sets. While it is set, waveforms and set-points are refused.
    keeper : KeeperLink, optional
        Keeper of the stage. The thread ends with an error when the keeper is lost.
    """

    patience = 0.5
    """Largest delay that the thread catches up with [s]; after a longer delay the time base is postponed."""

    def __init__(
        self,
        stage: Stage,
        playback: Source,
        time_base: TimeBase,
        block_size: int,
        *,
        node_clock: Callable[[], int],
        deliver: Callable[[Delivery], None],
        fail: Callable[[PiezoError], None],
        ready: Callable[[], bool] = lambda: True,
        latch: StopLatch | None = None,
        keeper: KeeperLink | None = None,
    ) -> None:
        self.stage, self.playback, self.tally = stage, playback, Tally()
        self.block_size, self.index = block_size, 0
        self._time_base, self._node_clock = time_base, node_clock
        self._deliver, self._fail, self._ready = deliver, fail, ready
        self._late = LatencyBuffer(round(stage.description.latency / time_base.sample_period), playback.phase.number)
        self._device_clock = DeviceClock(time_base) if stage.description.latency else None
        self._latch, self.keeper = latch or StopLatch(), keeper or NoKeeper()
        self._open, self._is_abandoned = OpenCommands(), False
        self._access = threading.Lock()  # for the playback: nothing slow is done with it
        self._accepting = threading.Lock()  # until the acceptance is reported; taken before `_access`
        self._ending, self._halting, self._safe = threading.Event(), threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="acquisition", daemon=True)

    def start(self) -> None:
        """Start the thread; sample 0 is taken now."""
        self._thread.start()

    def play(
        self,
        waveform: Samples,
        name: str,
        stamp: int,
        check: Callable[[Samples, float], None],
        accepted: Callable[[Phase, int], None],
    ) -> Phase:
        """Play a waveform [V] next; see `Playback.play`. StageError if it is refused.

        Parameters
        ----------
        waveform, name, stamp
            As for `Playback.play`.
        check : callable
            Called with the waveform and the present voltage [V]; it raises StageError to refuse the waveform.
        accepted : callable
            Called with the phase and its number of samples before an event of the phase is delivered.
        """
        with self._accepting:
            with self._access:
                self._latch.require_released(name)
                self._require_free(name)
                check(waveform, self.playback.voltage)
                phase = self.playback.play(waveform, name, stamp)
                self._open.add(phase)
            accepted(phase, waveform.size)
            return phase

    def _require_free(self, name: str) -> None:
        """Raise StageError if the waveform `name` cannot be played next."""
        self.playback.require_free(name)

    def ramp_to(self, voltage: float) -> None:
        """See `Playback.ramp_to`."""
        with self._access:
            self._latch.require_released("set_voltage")
            self.playback.ramp_to(voltage)

    def stop(self) -> tuple[Phase, bool]:
        """Forbid all motion until the latch is released, and end the present phase as `cancel` does."""
        self._latch.set()
        return self.cancel()

    def cancel(self) -> tuple[Phase, bool]:
        """End the present phase as `Playback.stop` does; returns it, and whether a waveform was being played."""
        with self._access:
            was_playing = self.playback.is_playing
            return self.playback.stop(), was_playing

    def make_safe(self, timeout: float) -> bool:
        """Stop, wait until the stage has reported the safe voltage, and end the thread.

        Returns False if the stage was not at the safe voltage within `timeout` [s]. True also if the thread had failed
        before: it has then made the stage safe or reported that it could not.
        """
        if not self.is_running:
            self._halting.set()  # it may be about to begin, if an interrupt came while it was started
            return True
        if not self._halting.is_set():
            self._safe.clear()
            self._ending.set()
            self.cancel()
            self._safe.wait(timeout)
        reached = self._safe.is_set()
        self._halting.set()
        self._thread.join(timeout)
        if self.is_running and not self._is_abandoned:
            self._is_abandoned = True  # its last samples come too late for everybody
            self._end_commands("a call of the stage does not return")
        return reached

    @property
    def is_running(self) -> bool:
        """True while the thread uses the stage."""
        return self._thread.is_alive()

    def _run(self) -> None:
        if self._halting.is_set():
            return
        try:
            while not self._ready():
                if self._ending.wait(0.01):
                    self._go_safe()
                    self._safe.set()
                    return
            self._time_base.anchor(0, *read_together(self._node_clock))
            while not self._halting.is_set():
                self.keeper.require()
                self.keeper.begin_step()
                was_safe, begin = self.playback.is_safe, self.index
                self._step()
                is_safe = self.playback.is_safe
                if self._late.has_settled(was_safe and is_safe, self.index - begin) and is_safe:
                    self._safe.set()
            if not self._safe.is_set():  # `make_safe` has given up, because a call of the stage took too long
                self._go_safe()
        except BaseException as error:  # the stage must not keep its voltage, also if a library ends the thread
            failure = self._abandon(error)
            self._fail(failure)
            self._end_commands(str(failure))
            self._safe.set()
        finally:
            self.keeper.end_step()

    def _go_safe(self) -> None:
        """Bring the stage to its safe voltage after a keeper that acts has ended, unless the keeper has the stage."""
        self.keeper.let_finish()
        if not self.keeper.has_stage:
            self.stage.safe()

    def _abandon(self, error: BaseException) -> PiezoError:
        try:
            self._go_safe()
        except BaseException as unsafe:
            return StageError(f"{error}; the stage could not be brought to its safe voltage: {unsafe}")
        return error if isinstance(error, PiezoError) else StageError(f"fault of the driver: {error!r}")

    def _end_commands(self, reason: str) -> None:
        """Deliver the end of the commands of which no further sample will be measured."""
        with self._access:
            events = self._open.stop(reason)
        if events:
            self._hand_over(Delivery.without_samples(self.index, events))

    def _step(self) -> None:
        if self._device_clock is None and not self._keep_pace():
            return
        with self._access:
            drive = self.playback.take(self.block_size)
        acquired = cast(StreamingStage, self.stage).exchange(drive.voltage)
        if self._device_clock is not None:
            self._device_clock.follow_block(self.index, self.block_size, self.tally)
        self._pass_on(self.index, self._late.follow(drive), acquired)

    def _keep_pace(self) -> bool:
        """Wait until the next block is due; returns False if the thread has to end before."""
        due = self._time_base.due(self.index + self.block_size)
        if not self._wait_until(due):
            return False
        now = time.monotonic()
        self.tally.latest = max(self.tally.latest, now - due)
        if now - due > self.patience:
            self.tally.postponed += self._time_base.postpone(self.index + self.block_size, now)
        return True

    def _wait_until(self, steady: float) -> bool:
        """Wait until a time on the steady clock [s]; returns False if the thread has to end before."""
        self.keeper.begin_step()
        return not self._halting.wait(max(steady - time.monotonic(), 0.0))

    def _pass_on(self, first: int, drive: Drive, acquired: Acquired) -> None:
        """Deliver samples that begin at index `first`; the samples before them were not measured."""
        self.tally.clock_jumps += abs(self._time_base.follow(first, *read_together(self._node_clock)))
        stamp, period = self._time_base.stamp(first), self._time_base.sample_period
        block = SampleBlock.acquired(acquired, drive.phase, stamp, period, first, follows_gap=first > self.index)
        self.tally.count(block, first - self.index)
        self.index = first + block.size
        self._open.follow(drive.events)
        if not self._is_abandoned:
            self._hand_over(Delivery(block, first, drive.events))

    def _hand_over(self, delivery: Delivery) -> None:
        """Deliver, after the commands that begin or end here were reported as accepted."""
        if delivery.events:
            with self._accepting:
                pass
        self._deliver(delivery)
