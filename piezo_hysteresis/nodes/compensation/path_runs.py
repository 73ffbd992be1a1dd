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

"""`PathRuns`: the jobs of the compensation node: plan and play a path, and play it again with corrections."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...compensation import IterativeLearning, Limits, Plan, plan
from ...errors import StageError, counted, printable
from ...identification.protocol.phases import ProtocolPhase
from ..identification.driver_client import DriverClient
from ..identification.wait_limit import WaitLimit
from .applied_state import AppliedState
from .job import TICK, Job, in_thread, rest
from .status import CompensationStatus
from .tracking import Tracking
from .trajectory import described, doubts, why_not

_STARTED_WITHIN = 20.0
"""Longest wait for the driver to begin with a waveform, or for its last samples [s]."""
_HEARD_WITHIN = 3.0
"""Shortest time after which a drive without an answer is sent again [s]: a new driver may not hear the first one."""
_ANSWERED_WITHIN = 1.0
"""Time for the answer to the oldest command that a driver plays [s]; after that it refuses the first one."""
_REST = 0.01
"""Largest change of the drive of a stage at rest, as a share of its range."""


class PathError(StageError):
    """A path that is not reachable."""


class PathRuns:
    """Jobs that advance by one step at every tick of the node.

    Parameters
    ----------
    driver : DriverClient
        Client of the driver, which plays the drive.
    status : CompensationStatus
        Publishes every step.
    values : mapping of str to object
        Parameters of the node.

    Attributes
    ----------
    tracking : Tracking or None
        Tracking of the drive that is being played.
    last : (str, Plan) or None
        Name and plan of the last trajectory.
    """

    def __init__(
        self,
        driver: DriverClient,
        status: CompensationStatus,
        values: Mapping[str, Any],
    ) -> None:
        self._driver, self._status, self._values = driver, status, values
        self.tracking: Tracking | None = None
        self.last: tuple[str, Plan] | None = None

    @property
    def is_driving(self) -> bool:
        """Whether the driver plays a drive of the running job, or may still begin with it."""
        return self.tracking is not None and self._driver.state not in ("refused", "stopped", "done")

    def planned(self, applied: AppliedState, wanted: np.ndarray, limits: Limits, way_back: bool = True) -> Plan:
        """Plan of a path (n,) [m] that starts at the present state of the stage, which `applied` contains."""
        found = plan(
            applied.model,
            wanted,
            limits,
            start=applied.state,
            approach=self._values["approach"],
            way_back=self._values["way_back"] if way_back else 0.0,
            approximate=self._values["approximate"],
        )
        return replace(found, start_is_known=applied.is_known)

    def _until(self, condition: Callable[[], bool], missing: str) -> Job:
        waited = 0.0
        while not condition():
            waited += TICK
            if waited > _STARTED_WITHIN:
                raise StageError(f"waited {_STARTED_WITHIN:g} s for {missing}")
            yield

    def _planned_at_rest(
        self, applied: AppliedState, wanted: np.ndarray, limits: Limits
    ) -> Generator[None, None, Plan]:
        """Plan a path; again while the stage has moved meanwhile, for example on its way to a set-point.

        Raises
        ------
        StageError
            If the stage moves for too long.
        """
        near, deadline = _REST * (limits.voltage_max - limits.voltage_min), time.monotonic() + _STARTED_WITHIN
        while True:
            begin = applied.voltage
            yield from rest()
            if abs(applied.voltage - begin) <= near:
                found: Plan = yield from in_thread(self.planned, applied, wanted, limits)
                begin = found.start.inputs[0]
                if abs(applied.voltage - begin) <= near:
                    return found
            if time.monotonic() > deadline:
                raise StageError(f"the stage moves from {begin:.4g} to {applied.voltage:.4g} V; let it come to rest")

    def follow(self, name: str, applied: AppliedState, wanted: np.ndarray, limits: Limits) -> Job:
        """Plan a path and play it.

        Raises
        ------
        PathError
            If a part of it is not reachable; nothing has moved.
        StageError
            If the driver refuses or stops the drive, or no samples arrive.
        """
        self._status.show("planning", counted(wanted.size, "sample"), name)
        yield from self._until(lambda: applied.is_ready, "the model to be run over the applied voltages")
        found = yield from self._planned_at_rest(applied, wanted, limits)
        self.last = (name, found)
        if not found.reachability.is_whole:
            raise PathError(why_not(found))
        if not self._values["play"]:
            self._status.show("planned", described(found), name, expected=found.expected.total)
            return
        tracking = yield from self._play(name, found)
        self._report_result(name, tracking)

    def _report_result(self, name: str, tracking: Tracking) -> None:
        rms, expected = tracking.rms or 0.0, tracking.plan.expected.total
        reason = f"{_rms_text(rms, expected, tracking)}{doubts(tracking.plan)}"
        self._status.show("done", reason, name, first_index=tracking.path_index, rms=rms, expected=expected)

    def _play(
        self, name: str, found: Plan, learning: IterativeLearning | None = None
    ) -> Generator[None, None, Tracking]:
        """Send a drive to the driver and collect what the stage does; `learning` if it is a round of it.

        Raises
        ------
        StageError
            If the driver refuses or stops the drive or is no longer there, or no samples arrive.
        """
        tracking = self.tracking = Tracking(found, None if learning is None else learning.wanted)
        expected = found.expected.total if learning is None else learning.expected
        self._status.show("playing", described(found, expected), name, expected=expected)
        drive = ProtocolPhase(name, found.voltage, found.sample_period)
        self._driver.send(drive)
        # a device that plays from its memory sends nothing before the end
        longest_silence = _STARTED_WITHIN + 2.0 * found.voltage.size * found.sample_period
        heard_within = max(_HEARD_WITHIN, self._driver.command_max_age + _ANSWERED_WITHIN)
        before, limit, unheard = (False, 0), WaitLimit(_STARTED_WITHIN), WaitLimit(heard_within)
        while not tracking.is_whole:
            state = self._driver.state
            if state == "done" and tracking.has_passed:
                break  # the last sample was lost
            if state != "sent":
                unheard = WaitLimit(heard_within)
            elif unheard.has_passed():
                self._driver.send(drive)
                unheard = WaitLimit(heard_within)
            if state in ("refused", "stopped"):
                raise StageError(f"the driver {state} it: {self._driver.reason}")
            if self._driver.limits is None:
                raise StageError(f"{self._driver.missing} is no longer there; see the log of the driver")
            if tracking.first is None and state in ("playing", "done"):
                tracking.begin(self._driver.first_index)
            longest = longest_silence if state == "playing" else _STARTED_WITHIN
            if (now := (state == "playing", tracking.received)) != before:
                before, limit = now, WaitLimit(longest)
            if limit.has_passed():
                raise StageError(
                    f"the driver is '{state}' and sends no samples of the drive for {longest:g} s; is it alive?"
                )
            yield
        if tracking.rms is None:
            raise StageError("it was played, but no displacement was measured on the path; see the log of the driver")
        return tracking

    def rounds(self, name: str, applied: AppliedState, first: Plan, limits: Limits) -> Job:
        """Play the last trajectory again, corrected by the measurement; no other program drives the stage meanwhile.

        Raises
        ------
        StageError
            If another program has claimed the stage, or the driver refuses or stops a round.
        """
        self._driver.claim()
        try:
            yield from self._until(lambda: bool(self._driver.holder), "the claim on the stage")
            yield from self._learn(name, applied, first, limits)
        finally:
            self._driver.release()

    def _learn(self, name: str, applied: AppliedState, first: Plan, limits: Limits) -> Job:
        yield from self._until(lambda: applied.is_ready, "the model to be run over the applied voltages")
        learning = IterativeLearning(
            applied.model,
            first,
            limits,
            noise=self._values["sensor_noise"] or applied.noise,
            approximate=self._values["approximate"],
        )
        # the stage is no longer where the first plan began
        again = yield from self._planned_at_rest(applied, first.wanted, limits)
        learning.next = again if again.reachability.is_whole else None
        for number in range(1 + self._values["learning_rounds"]):
            if learning.next is None:
                break
            if not self._driver.owns:
                raise StageError(
                    f"the stage is claimed by {printable(self._driver.holder) or 'nobody'}, not by this node"
                )
            tracking = yield from self._play(f"{name}_{number}", learning.next, learning)
            yield from rest()
            yield from in_thread(learning.update, tracking.measured, applied.state)
            now = learning.rounds[-1]
            reason = f"round {number}: {_rms_text(now.rms, now.expected, tracking)}"
            index = tracking.path_index
            self._status.show(
                "learning", reason, f"{name}_{number}", first_index=index, rms=now.rms, expected=now.expected
            )
        if not learning.rounds:
            raise StageError("the trajectory can no longer be reached from the present position of the stage")
        last = learning.rounds[-1]
        reason = ", ".join(f"{1e9 * r.rms:.1f}" for r in learning.rounds)
        reason = f"{reason} nm rms in {counted(len(learning.rounds), 'round')}" + (
            f"; {learning.reason}" if learning.reason else ""
        )
        self._status.show("done", reason, name, rms=last.rms, expected=last.expected, best=learning.best.rms)


def _rms_text(rms: float, expected: float, tracking: Tracking) -> str:
    missing = f"; {counted(tracking.missing, 'sample')} missing" if tracking.missing else ""
    return f"{1e9 * rms:.1f} nm rms, expected {1e9 * expected:.1f} nm{missing}"
