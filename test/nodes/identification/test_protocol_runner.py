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

"""A stage that fails in mid-phase ends the protocol at once, with a recording that can be read."""

import signal
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import KeyValue
from std_msgs.msg import String
from std_srvs.srv import Trigger

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.identification.protocol.phases import ProtocolPhase
from piezo_hysteresis.identification.protocol.protocol import Protocol
from piezo_hysteresis.nodes.driver.driver_node import DriverNode
from piezo_hysteresis.nodes.identification.driver_client import DriverClient
from piezo_hysteresis.nodes.identification.protocol_runner import run_protocol
from piezo_hysteresis.nodes.runtime.qos import LATCHED
from piezo_hysteresis.recording import read
from piezo_hysteresis.stage import back_ends
from piezo_hysteresis.stage.opening import BackEnd

from ...acquisition.witness import Witness

pytestmark = pytest.mark.nodes

PERIOD = 1e-3


@pytest.fixture
def stage(monkeypatch):
    """A stage that notes what becomes of it, driven as a device."""
    stage = Witness(PERIOD, 1e6)
    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", BackEnd("simulated", (), lambda *_: stage, is_device=True))
    return stage


def begun(lab, voltage, before=lambda link: None, phases=1, first=lambda: None):
    """The protocol of one phase with a driver, as a function that calls `before`, carries it on and returns its end.

    `first` is called when the driver runs and nobody has asked it for anything yet.
    """
    node = lab.add(DriverNode, discovery_time=0.0)
    lab.do(node.begin)
    lab.driver_node = node
    first()
    link = lab.do(lambda: DriverClient(lab.node, "driver_node"))
    lab.wait(lambda: not link.missing, "the driver")
    phase, path = ProtocolPhase("long", voltage, PERIOD), lab.folder / "run"
    job = run_protocol(lab.node, link, lambda limits: Protocol("long", limits, (phase,) * phases), path)

    def step():
        try:
            before(link)
        except StageError as error:
            job.close()
            return error
        try:
            return next(job)
        except (StageError, StopIteration) as error:
            return error

    def carry_on():
        time.sleep(0.02)
        ended_with = lab.do(step)
        return ended_with if isinstance(ended_with, Exception) else None

    return carry_on


def test_a_driver_that_gives_its_stage_up_ends_the_protocol(lab, stage):
    samples = lab.samples()
    carry_on = begun(lab, np.concatenate((np.zeros(100), np.full(60_000, 0.1), np.zeros(100))))

    def ended():
        if samples.blocks and samples.newest.phase[-1] == 1 and (samples.phase == 1).sum() > 1000:
            stage.exchange = lambda block: 1 / 0
        return carry_on()

    ended_with = lab.wait(ended, "the end of the protocol")
    assert "phase 'long' was stopped: fault of the driver: ZeroDivisionError" in str(ended_with)
    assert stage.made_safe >= 1
    assert {record.phase for record in read(lab.folder / "run")} == {"long"}


def test_a_word_that_is_lost_is_not_waited_for_without_limit(lab, stage, monkeypatch):
    monkeypatch.setattr("piezo_hysteresis.nodes.identification.protocol_runner.PATIENCE", 5.0)

    def unheard(link):
        if link.state == "done":
            link.state = "playing"  # as where a flood of others' refusals has pushed the word out

    ended_with = lab.wait(begun(lab, np.zeros(200), unheard), "the end of the protocol")
    assert "did not report its end" in str(ended_with)
    assert {record.phase for record in read(lab.folder / "run")} == {"long"}


def test_a_stage_that_was_moved_between_two_phases_ends_the_protocol(lab, stage, monkeypatch):
    """By what no claim keeps out: the device itself."""
    monkeypatch.setattr("piezo_hysteresis.nodes.identification.protocol_runner._SETTLING", 0.5)
    moved = []

    def push(link):
        if link.state == "done" and not moved:
            moved.append(True)
            lab.driver_node._session.streaming.ramp_to(3.0)

    ended_with = lab.wait(begun(lab, np.zeros(200), push, phases=2), "the end of the protocol")
    assert "instead of 0 V" in str(ended_with)
    assert "another program has moved the stage" in str(ended_with)


@pytest.mark.parametrize("is_aborted", [False, True])
def test_a_stage_that_another_program_claimed_is_left_to_it(lab, stage, is_aborted):
    """Neither the refusal nor an abort before it ends what the owner plays."""

    def claim_and_move():
        claims, holders = lab.publisher(KeyValue, "claim"), lab.listen(String, "claimed_by", LATCHED)
        lab.wait(claims.get_subscription_count, "the driver")
        claims.publish(KeyValue(key="another_lab", value="claim"))
        lab.wait(lambda: holders and holders[-1].data == "another_lab", "the claim")
        lab.driver_node._session.streaming.ramp_to(3.0)
        lab.wait(lambda: stage.voltage == 3.0, "the voltage of the owner")

    def abort(link):
        if is_aborted and link.holder:
            raise StageError("aborted")

    carry_on = begun(lab, np.zeros(200), abort, first=claim_and_move)
    ended_with = lab.wait(carry_on, "the end of the protocol")
    assert ("aborted" if is_aborted else "the stage is claimed by another_lab") in str(ended_with)
    lab.pause(1.0)
    assert stage.voltage == 3.0


def test_a_protocol_does_not_begin_after_a_stop_without_release(lab, stage):
    """Asked for before the release: nothing is recorded or played, and the reason is the stop."""
    ended_with = lab.wait(begun(lab, np.full(200, 1.0), first=lambda: lab.call(Trigger, "driver_node/stop")), "the end")
    assert str(ended_with) == "the driver was stopped and moves nothing; call driver_node/release first"
    assert not (lab.folder / "run").exists()
    assert stage.voltage == 0.0


def test_a_stop_between_two_phases_ends_the_protocol_with_its_reason(lab, stage):
    stopped = []

    def stop(link):
        if link.state == "done" and not stopped:
            stopped.append(lab.driver_node._commands._stop())

    ended_with = lab.wait(begun(lab, np.zeros(200), stop, phases=2), "the end of the protocol")
    assert "phase 'long' was refused: " in str(ended_with)
    assert "the driver was stopped and moves nothing; call ~/release first" in str(ended_with)
    assert {record.phase for record in read(lab.folder / "run")} == {"long"}
    lab.call(Trigger, "driver_node/release")
    lab.wait(lambda: stage.voltage == 0.0, "the safe voltage")


@pytest.mark.soak
def test_a_new_driver_is_claimed_again(lab):
    """Killed with a question unanswered: its services are known for a while, and those of the next one are the same."""
    driver = lab.driver(sample_period=PERIOD)
    lab.streaming()
    link = lab.do(lambda: DriverClient(lab.node, "driver_node"))
    lab.wait(lambda: link.limits is not None, "its limits")
    driver.signal(signal.SIGSTOP)
    lab.wait(lambda: link._pending is not None and not link._pending.done() and not link.is_fresh, "a question")
    driver.signal(signal.SIGKILL)
    driver.wait()
    lab.forget()
    lab.driver(sample_period=PERIOD, voltage_max=7.0)
    lab.wait(lambda: link.limits is not None and link.limits.voltage_max == 7.0, "the limits of the next one")
    assert link.is_fresh
