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

"""`run_protocol`: plays a protocol to the stage phase by phase and records everything."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ...errors import PiezoError, RecordingError, StageError
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import ProtocolPhase
from ...identification.protocol.protocol import Protocol
from ..runtime.guarded_node import GuardedNode
from .bag_recorder import BagRecorder
from .driver_client import DriverClient
from .wait_limit import WaitLimit

T = TypeVar("T")
"""Type of the value that a wait returns."""

PATIENCE = 30.0
"""Longest wait for the driver, for an answer, and for samples [s]."""

_SETTLING = 5.0
"""Longest wait for the voltage at which a phase begins [s]."""

_NEWER = 2
"""Number of messages of 'voltage' to wait for after a phase; the first may have been sent before its end."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a long job.

    Parameters
    ----------
    state : str
        ``waiting``, ``running``, ``deciding`` or ``fitting``.
    reason : str
        One line.
    fraction : float
        Fraction of this state that is done, 0 to 1.
    phase : str
        ``"3 of 16 noise"`` while a phase is played.
    """

    state: str
    reason: str
    fraction: float = 0.0
    phase: str = ""


Following = Callable[[DriveLimits], Generator[Progress, None, Protocol | None]]
"""Generator that returns the next protocol within the limits, or None at the end, and yields its progress."""


def run_protocol(
    node: GuardedNode, driver: DriverClient, plan: Callable[[DriveLimits], Protocol], path: Path
) -> Generator[Progress]:
    """Play and record a protocol, as `run_protocols` does.

    Parameters
    ----------
    node, driver, path
        As for `run_protocols`.
    plan : callable
        Returns the protocol for the limits of the driver.
    """
    planned: list[Protocol] = []

    def once(limits: DriveLimits) -> Generator[Progress, None, Protocol | None]:
        if planned:
            return None
        planned.append(plan(limits))
        yield Progress("waiting", "for the stage")
        return planned[0]

    yield from run_protocols(node, driver, once, path)


def run_protocols(node: GuardedNode, driver: DriverClient, following: Following, path: Path) -> Generator[Progress]:
    """Play protocols and record them into one bag. The generator has to be resumed at short intervals until it ends.

    Closing the generator aborts: the driver is asked to go to its safe voltage, and the recording is finished. A
    failure does the same. A stage that was not claimed by then is left to the program that drives it.

    Parameters
    ----------
    node : GuardedNode
        The identification node.
    driver : DriverClient
        The stage.
    following : callable
        Determines the next protocol. Meanwhile the stage is at its safe voltage and stays claimed.
    path : Path
        Folder of the bag.

    Raises
    ------
    StageError
        If there is no driver, a phase is refused or stopped, or no samples arrive.
    RecordingError
        If the bag cannot be written.
    IdentificationError
        If a protocol does not fit the limits.
    """
    limits = yield from _until(lambda: driver.limits, lambda: driver.missing)
    if driver.stopped:
        raise StageError(driver.stopped)
    protocol = yield from following(limits)
    if protocol is None:
        return
    recorder = BagRecorder(node, path)
    try:
        for progress in _all_protocols(driver, recorder, protocol, following, path):
            if recorder.failure is not None:
                raise recorder.failure
            yield progress
    except BaseException as error:  # also where the generator was closed
        if driver.owns:
            driver.stop()
        driver.release()
        _close_after(error, recorder)
        raise
    driver.release()
    recorder.close()


def _all_protocols(
    driver: DriverClient, recorder: BagRecorder, protocol: Protocol | None, following: Following, path: Path
) -> Generator[Progress]:
    yield from _claim(driver, recorder)
    while protocol is not None:
        yield from _all_phases(driver, recorder, protocol, path)
        protocol = yield from following(protocol.limits)


def _close_after(error: BaseException, recorder: BagRecorder) -> None:
    """End the recording of a protocol that failed; if that fails too, both errors are reported."""
    try:
        recorder.close()
    except RecordingError as lost:
        both = f"{error}; {lost}" if isinstance(error, PiezoError) else str(lost)
        raise RecordingError(both) from error


def _claim(driver: DriverClient, recorder: BagRecorder) -> Generator[Progress]:
    """Wait until samples are recorded, claim the stage, and wait until it is at its safe voltage."""
    seen = recorder.counts
    yield from _until(
        lambda: not driver.missing and seen["samples"] > 0 and seen["phase"] > 0,
        lambda: driver.missing or "samples",
    )
    driver.claim()
    yield from _until(lambda: bool(driver.holder), lambda: "the claim on the stage")
    _require_claim(driver)
    if not driver.is_safe:
        driver.stop()
        yield from _until(lambda: driver.is_safe, lambda: "the safe voltage")


def _all_phases(driver: DriverClient, recorder: BagRecorder, protocol: Protocol, path: Path) -> Generator[Progress]:
    done = 0.0
    for number, phase in enumerate(protocol, 1):
        progress = Progress(
            "running", str(path), done / protocol.summary.duration, f"{number} of {len(protocol)} {phase.name}"
        )
        yield from _go_to_start(driver, phase, progress)
        yield from _play(driver, recorder, phase, progress)
        done += phase.duration
    # the recording lags behind the status while the computer is busy
    end = driver.first_index + protocol.phases[-1].voltage.size
    yield from _until(lambda: recorder.holds(end), lambda: "the last samples")


def _until(wanted: Callable[[], T | None], missing: Callable[[], str]) -> Generator[Progress, None, T]:
    """Wait until `wanted` returns something true, and return that."""
    limit = WaitLimit(PATIENCE)
    while not (found := wanted()):
        if limit.has_passed():
            raise StageError(f"waited {PATIENCE:g} s, but did not find {missing()}")
        yield Progress("waiting", f"for {missing()}")
    return found


def _require_claim(driver: DriverClient) -> None:
    if driver.holder and not driver.owns:
        raise StageError(driver.blocked)
    if not driver.owns:
        raise StageError("the claim on the stage has ended: this node was suspended or the driver restarted")


def _go_to_start(driver: DriverClient, phase: ProtocolPhase, progress: Progress) -> Generator[Progress]:
    """Wait for new messages of 'voltage' before a phase is sent, because the known voltage may be outdated."""
    seen, limit = driver.voltages, WaitLimit(_SETTLING)
    while True:
        reason = driver.misplaced(float(phase.voltage[0]))
        if not reason and driver.voltages >= seen + _NEWER:
            return
        if limit.has_passed():
            why = f"{reason}; another program has moved the stage" if reason else "no message arrives on 'voltage'"
            raise StageError(f"phase '{phase.name}': {why}")
        yield progress


def _play(driver: DriverClient, recorder: BagRecorder, phase: ProtocolPhase, progress: Progress) -> Generator[Progress]:
    _require_claim(driver)
    driver.send(phase)
    # a device that plays from its memory sends nothing before the end
    longest_silence = PATIENCE + 2.0 * phase.duration
    answer, end = WaitLimit(PATIENCE), WaitLimit(PATIENCE)
    seen, silence = recorder.counts["samples"], WaitLimit(longest_silence)
    while driver.state != "done":
        if driver.state in ("refused", "stopped"):
            raise StageError(f"phase '{phase.name}' was {driver.state}: {driver.reason}")
        if driver.state in ("sending", "sent") and answer.has_passed():
            raise StageError(f"phase '{phase.name}': no answer on 'command_status' within {PATIENCE:g} s")
        if driver.limits is None:
            raise StageError(
                f"phase '{phase.name}': {driver.missing} is no longer there; see /diagnostics and the log of the driver"
            )
        _require_claim(driver)
        if recorder.counts["samples"] > seen:
            seen, silence = recorder.counts["samples"], WaitLimit(longest_silence)
        if silence.has_passed():
            raise StageError(f"phase '{phase.name}': no samples for {longest_silence:g} s; is the driver alive?")
        is_played = driver.state == "playing" and recorder.holds(driver.first_index + phase.voltage.size)
        if is_played and end.has_passed():
            raise StageError(
                f"phase '{phase.name}' was played, but the driver did not report its end; check whether "
                "others send many commands"
            )
        yield progress
