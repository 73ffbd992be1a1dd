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

"""Long waveforms: the node goes on while one is packed, its age is that of its way, and what was called off stays."""

import threading
import time

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.identification.protocol.phases import ProtocolPhase
from piezo_hysteresis.nodes.identification.command_sender import CommandSender
from piezo_hysteresis.nodes.identification.driver_client import DriverClient

pytestmark = pytest.mark.nodes

PERIOD = 2e-5
MAX_AGE = 5.0
"""Oldest command that is played [s]; 96 MB take seconds on a busy machine."""


class SlowToPack:
    """A waveform that takes longer to pack than a command may be old."""

    def __init__(self, voltage, delay):
        self._voltage, self._delay, self.begun = voltage, delay, threading.Event()

    def __array__(self, dtype=None, copy=None):
        self.begun.set()
        time.sleep(self._delay)
        return self._voltage


@pytest.fixture(scope="module")
def link(shared_lab):
    """The driver as the identification node sees it, and the states that its node saw while it went on."""
    lab = shared_lab
    lab.driver(simulated__electronics__dac_bits=0.0, command_max_age=MAX_AGE)
    lab.streaming()
    link = lab.do(lambda: DriverClient(lab.node, "driver_node"))
    link.seen = []
    lab.node.create_timer(0.005, lambda: link.seen.append(link.state))
    lab.wait(lambda: not link.missing, "the driver")
    return link


def test_the_client_knows_how_long_the_driver_can_play_a_late_command(link):
    assert link.command_max_age == MAX_AGE


def test_packing_a_long_waveform_blocks_no_callback_and_keeps_it_valid(shared_lab, link):
    lab = shared_lab
    samples = lab.samples()
    wave = np.linspace(0, 1, 2000)
    lab.do(lambda: link.send(ProtocolPhase("slow", SlowToPack(wave, 1.05 * MAX_AGE), PERIOD)))
    lab.wait(lambda: link.state in ("done", "refused"), "the end of the phase")
    assert (link.state, link.reason) == ("done", "done")
    assert link.seen.count("sending") > 10, "the node went on meanwhile"
    lab.wait(lambda: samples.newest.voltage[-1] == 1.0, "the last sample")


def test_eighty_seconds_of_drive_in_one_message(shared_lab, link):
    lab = shared_lab
    lab.do(lambda: link.send(ProtocolPhase("staircase", np.zeros(4_000_000), PERIOD)))
    lab.wait(lambda: link.state in ("playing", "refused"), "the phase")
    assert link.state == "playing", link.reason
    statuses = lab.statuses()
    assert lab.do(link.stop) is not None
    lab.wait(lambda: "stopped" in lab.states(statuses, "staircase"), "the stop")


def test_a_waveform_cancelled_during_packing_is_not_sent(shared_lab, link):
    lab = shared_lab
    statuses = lab.statuses()
    slow = SlowToPack(np.full(2000, 1.0), 0.5)
    lab.do(lambda: link.send(ProtocolPhase("called_off", slow, PERIOD)))
    assert slow.begun.wait(30.0)
    lab.do(link.stop)
    sent = []

    def played():
        """Whether the next command was; it is sent again where it came while the stage went to its safe voltage."""
        states = lab.states(statuses, "next")
        if states.count("refused") == len(sent):
            sent.append(lab.send(np.linspace(0, 1, 2000), "next"))
        return "done" in states

    lab.wait(played, "the next command")
    assert lab.states(statuses, "called_off") == []


def test_a_phase_waits_for_no_confirmation_of_the_one_before_it(shared_lab, link, monkeypatch):
    """It comes seconds later, or never where a reader has died; the node would renew no claim and record nothing."""
    lab = shared_lab
    waited = []
    monkeypatch.setattr(link._command._publisher, "wait_for_all_acked", waited.append)
    for name in ("one", "two"):
        lab.do(lambda name=name: link.send(ProtocolPhase(name, np.zeros(500), PERIOD)))
        lab.wait(lambda: link.state in ("done", "refused"), "the end of the phase")
        assert link.state == "done", link.reason
    lab.do(link.stop)
    assert not waited, "the driver had answered"


def test_only_the_driver_counts_as_a_subscriber_of_commands(shared_lab, link):
    lab = shared_lab
    sender = CommandSender(lab.second_node("sender"))
    lab.second_node("recorder").create_subscription(PointCloud2, "command", lambda cloud: None, 10)
    lab.wait(lambda: sender.reaches("recorder") and sender.reaches("driver_node"), "both")
    assert not sender.reaches("other_driver")
