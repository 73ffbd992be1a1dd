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

"""`DriverSession`: an opened stage with its limits and its lock, as a configured driver uses it. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from ..errors import PiezoError, StageError
from ..record import Record
from ..stage.back_ends import BACK_ENDS, open_stage
from ..stage.description import Description
from ..stage.opening import Opening
from ..stage.replay import ReplayStage
from ..stage.stage import Stage
from .command_check import CommandCheck
from .memory import MemoryAcquisition
from .playback import Playback
from .recorded_playback import RecordedPlayback, Source
from .safety.keeper_link import KeeperLink
from .safety.stop_latch import StopLatch
from .sample_block import Delivery
from .settings import DriverSettings
from .stage_lock import StageLock
from .streaming import StreamingAcquisition
from .time_base import TimeBase

_KEEPER_TIME = 10.0
"""Longest wait for the keeper of a stage that this driver could not make safe, in addition to two ramps [s]."""


_STREAMING: set[DriverSession] = set()
"""Sessions that use their stage. Lock and stage are kept also if nobody refers to a session whose stage hangs."""


class DriverSession:
    """An opened stage. It streams samples between `start` and `make_safe`, which may be repeated until `close`.

    Parameters
    ----------
    settings : DriverSettings
        Settings of the driver.
    values : mapping
        Values of the parameters of the back end, by name.
    place : str
        Description of the topic and domain, which no other driver may use.
    read : callable, optional
        Function that reads the records of a recording from its path, for the stage `replay`.
    latch : StopLatch, optional
        A latch that exists longer than the session; by default the session creates its own.

    Raises
    ------
    PiezoError
        If the stage cannot be opened, has another driver, or does not allow the settings.
    """

    def __init__(
        self,
        settings: DriverSettings,
        values: Mapping[str, Any],
        place: str,
        read: Callable[[str], Iterable[Record]] | None = None,
        latch: StopLatch | None = None,
    ) -> None:
        self.settings, self._values = settings, values
        self.latch = StopLatch() if latch is None else latch
        self._lock = StageLock([place])
        self._keeper: KeeperLink | None = None
        self._acquisition: StreamingAcquisition | None = None
        self._is_stuck = False
        opening = Opening(settings.sample_period, settings.real_time_factor)
        if read is not None:
            opening = replace(opening, read=read)
        try:
            self.stage = open_stage(settings.stage, values, opening, self._lock_device, settings.slowest_rate)
        except BaseException:
            self._lock.release()
            raise
        try:
            self.limits = settings.limits(self.stage.description, self.stage.sample_period)
            self.stage.restrict(self.limits, settings.ramp_rate)
            self._keeper = self._kept()
        except BaseException:
            self.close()
            raise
        self.sample_period = self.stage.sample_period
        self.check = CommandCheck(self.limits, self.sample_period, settings.command_max_age)

    @property
    def streaming(self) -> StreamingAcquisition:
        """The running acquisition; raises StageError while there is none."""
        if self._acquisition is None:
            raise StageError("the driver is not active; activate it")
        return self._acquisition

    def start(
        self,
        *,
        node_clock: Callable[[], int],
        deliver: Callable[[Delivery], None],
        fail: Callable[[PiezoError], None],
        subscribers: Callable[[], int],
    ) -> StreamingAcquisition:
        """Begin to stream at the present voltage; see `StreamingAcquisition` for the parameters.

        Raises
        ------
        StageError
            If the acquisition that was started before still uses the stage, or a stage that was left outside the limits
            cannot be brought to its safe voltage.
        """
        if self._acquisition is not None and self._acquisition.is_running:
            raise StageError(
                f"{self.limits.name}: the acquisition that was started before still uses the stage; stop it first, or "
                "end this program if a call of the stage does not return"
            )
        if self._is_outside:
            self.stage.safe()  # no waveform may begin there
        settings = self.settings
        wanted = self._values.get("subscribers", 0)
        acquisition = (StreamingAcquisition if self.limits.streaming else MemoryAcquisition)(
            self.stage,
            self._source(self.stage),
            TimeBase(self.sample_period, settings.real_time_factor),
            settings.block_size(self.sample_period),
            node_clock=node_clock,
            deliver=deliver,
            fail=fail,
            ready=lambda: subscribers() >= wanted,
            latch=self.latch,
            keeper=self._keeper,
        )
        if isinstance(acquisition, MemoryAcquisition):
            acquisition.rest_period = 1 / settings.live_rate
        _STREAMING.add(self)
        self._acquisition = acquisition  # before the thread, so that an interrupt between the two cannot forget it
        acquisition.start()
        return acquisition

    @property
    def notices(self) -> tuple[str, ...]:
        """Sentences about the stage that a user should read before it moves."""
        if isinstance(self.stage, ReplayStage):
            return self.stage.notices
        low, high, safe = self.limits.voltage_min, self.limits.voltage_max, self.limits.safe_voltage
        ramp = f"found at {self.stage.voltage:g} V, outside {low:g} to {high:g} V; the start ramps it to {safe:g} V"
        return (f"{self.limits.name}: {ramp}, the safe voltage",) if self._is_outside else ()

    @property
    def _is_outside(self) -> bool:
        """Whether a stream could not begin at the voltage at which another program has left the stage."""
        limits = self.limits
        streams = limits.streaming and not limits.ignores_drive
        return streams and not limits.voltage_min <= self.stage.voltage <= limits.voltage_max

    def in_force(self) -> dict[str, float | str | bool]:
        """The values in use, by the names of `IN_FORCE`."""
        return self.settings.in_force(self.limits, self.sample_period) | {"stopped": self.latch.is_set}

    def _lock_device(self, found: Description) -> None:
        if BACK_ENDS[self.settings.stage].is_device:
            self._lock.add(f"device {found.name}")

    def _kept(self) -> KeeperLink | None:
        """The keeper of the device, if its back end has one and it is not switched off."""
        s, period = self.settings, self.stage.sample_period
        if not (BACK_ENDS[s.stage].has_keeper and s.keeper_timeout):
            return None
        times, locks = (s.keeper_timeout, self._longest_step()), self._lock.descriptors
        return KeeperLink(s.stage, self._values, period, self.limits, s.ramp_rate, *times, locks)

    def _longest_step(self) -> float:
        """Time within which a working stage reaches its safe voltage and answers every call [s]."""
        settings, period = self.settings, self.stage.sample_period
        block = settings.block_size(period) * period / settings.real_time_factor
        once = settings.longest_ramp(self.limits) + self.limits.latency + self._values.get("timeout", 0.0)
        return 2.0 + 2.0 * (once + block)

    def _source(self, stage: Stage) -> Source:
        if isinstance(stage, ReplayStage):
            return RecordedPlayback(stage.phases, stage.voltage, self._values["repeat"])
        settings, safe = self.settings, self.limits.safe_voltage
        playback = Playback(stage.voltage, safe, self.sample_period, settings.ramp_rate, settings.hold_timeout)
        if abs(stage.voltage - safe) > settings.ramp_rate * self.sample_period:
            playback.stop()  # a killed driver or another program has left the stage at this voltage
        return playback

    def make_safe(self) -> None:
        """Ramp to the safe voltage and end the stream; does nothing without a stream.

        Raises
        ------
        StageError
            If the ramp was not finished in time; the stage has then been commanded to go there by itself. If a call of
            the stage does not return, its keeper makes it safe.
        """
        if self._acquisition is None:
            return
        timeout = 0.0 if self._is_stuck else self._longest_step()
        reached = self._acquisition.make_safe(timeout)
        self._is_stuck = self._acquisition.is_running
        if self._is_stuck:
            if self._keeper is not None:
                self._keeper.abandon()
            raise StageError(
                f"{self.limits.name}: a call of the stage does not return; its voltage is unknown, "
                f"{'its keeper was asked to make it safe' if self._keeper else 'and it has no keeper'}; end this "
                "program, and switch the amplifier off by hand"
            )
        self._acquisition = None
        _STREAMING.discard(self)
        self.stage.safe()  # ends the stream of a device
        if not reached:
            raise StageError(
                f"{self.limits.name}: not at the safe voltage within {timeout:g} s; the stage went there by itself"
            )

    def close(self) -> None:
        """End the stream, bring the stage to its safe voltage, and release stage and lock.

        Raises
        ------
        StageError
            If the stage did not reach it. The message then also states whether its keeper has reached it.
        """
        try:
            self.make_safe()
        finally:
            if self._acquisition is None:  # otherwise its thread still uses the device
                try:
                    self._close_stage()
                finally:
                    self._lock.release()

    def _close_stage(self) -> None:
        keeper = self._keeper
        if keeper is not None:
            keeper.let_finish()  # it may have acted before the stream began: only one process may move the stage
        try:
            self.stage.close()
        except BaseException as error:
            if keeper is None:
                raise
            outcome = keeper.hand_over(_KEEPER_TIME + 2.0 * self.settings.longest_ramp(self.limits))
            if not isinstance(error, StageError):
                raise
            raise StageError(f"{error}; {outcome}") from None
        if keeper is not None:
            keeper.close()
