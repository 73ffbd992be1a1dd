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

"""Only the node that runs a protocol moves the stage.

Others get the reason of the refusal, and its death frees the stage.
"""

import signal
import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import KeyValue
from std_msgs.msg import Float64, String

from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED

from ..identification.test_identification_node import Identification

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
RAMP_RATE = 50.0


class Axis:
    """A driver, who claims it, and what it refuses."""

    def __init__(self, lab, **parameters):
        self.lab = lab
        named = {"sample_period": PERIOD, "claim_timeout": 4.0, "ramp_rate": RAMP_RATE, **parameters}
        self.driver = lab.driver(simulated__electronics__dac_bits=0.0, **named)
        self.samples, self.statuses = lab.streaming(), lab.statuses()
        self.holders = lab.listen(String, "claimed_by", LATCHED)
        self.set_voltage, self.claims = lab.publisher(Float64, "set_voltage"), lab.publisher(KeyValue, "claim")
        lab.wait(lambda: self.holders, "who claims the stage")

    def claim(self, owner, word="claim"):
        self.claims.publish(KeyValue(key=owner, value=word))

    def held_by(self, owner):
        self.lab.wait(lambda: self.holders[-1].data == owner, f"{owner or 'nobody'} to hold the claim")

    def refusals(self, name):
        return [s.message for s in list(self.statuses) if s.name == name and values_of(s)["state"] == "refused"]

    def at(self, voltage):
        self.lab.wait(lambda: abs(self.samples.newest.voltage[-1] - voltage) < 1e-6, f"{voltage:g} V")


def test_foreign_motion_is_kept_out_of_a_protocol(lab):
    """A set-point a hundred times a second, before and during an identification: none gets in between two phases."""
    axis, ended = Axis(lab, real_time_factor=4.0), threading.Event()

    def flood():
        while not ended.wait(0.01):
            axis.set_voltage.publish(Float64(data=8.0))

    identification = Identification(lab)
    thread = threading.Thread(target=flood)
    thread.start()
    try:
        axis.at(8.0)
        assert lab.wait(lambda: identification.ask("identify").success, "the start")
        reported = identification.await_state("running", "failed")
        owner = values_of(reported)["owner"]
        assert owner
        axis.held_by(owner)
        reports = lab.diagnostics()
        lab.wait(
            lambda: (values_of(identification.statuses[-1])["phase"] or "0").startswith("4 of"), "the fourth phase"
        )
        lab.wait(
            lambda: any(values_of(s).get("claimed_by") == owner for r in list(reports) for s in r.status),
            "the claim on /diagnostics",
        )
        assert any(f"claimed by {owner}" in reason for reason in axis.refusals("set_voltage"))
        lab.send(np.zeros(10), "foreign", PERIOD)
        lab.wait(lambda: axis.refusals("foreign"), "the refusal of a foreign command")
        assert f"claimed by {owner}" in axis.refusals("foreign")[0]
        samples = axis.samples.so_far()
        played = np.flatnonzero(np.diff(samples.phase.astype(np.int64)))
        between = played[samples.phase[played + 1] >= 2]  # 1 is the hold of the flood
        assert between.size >= 5
        assert np.abs(np.diff(samples.voltage))[between].max() <= RAMP_RATE * PERIOD + 1e-9
        assert np.abs(samples.voltage[between]).max() < 0.1
        assert identification.ask("abort").success
        identification.await_state("aborted")
        axis.held_by("")
        axis.at(8.0)
    finally:
        ended.set()
        thread.join()


def test_an_owner_that_dies_gives_the_stage_free_at_its_safe_voltage(lab):
    axis = Axis(lab)
    identification = Identification(lab)
    identification.begin()
    owner = axis.holders[-1].data
    axis.claim("other")
    lab.wait(lambda: axis.refusals("claim"), "the refusal of another claim")
    assert f"claimed by {owner}" in axis.refusals("claim")[0]
    axis.claim("other", "release")
    identification.process.signal(signal.SIGKILL)
    axis.held_by("")
    lab.wait(lambda: all((b.voltage == 0.0).all() for b in axis.samples.blocks[-20:]), "the safe voltage")
    axis.claim("other")
    axis.held_by("other")
    lab.send([0.0, 0.0], "of_nobody", PERIOD)
    lab.send([0.0, 0.0], "of_other@other", PERIOD)
    lab.wait(lambda: "done" in lab.states(axis.statuses, "of_other"), "a command of the owner")
    assert "claimed by other" in axis.refusals("of_nobody")[0]
    axis.claim("other", "renew")
    axis.held_by("")  # it was not renewed again
    count = len(axis.holders)
    axis.claim("other", "renew")
    axis.claim("third")
    axis.held_by("third")
    assert [message.data for message in axis.holders[count:]] == ["third"], "a claim that has ended is not renewed"


def test_a_claim_that_ends_brings_the_stage_to_its_safe_voltage(lab):
    axis = Axis(lab, claim_timeout=60.0)
    axis.claim("bench")
    axis.held_by("bench")
    lab.send(np.concatenate((np.linspace(0, 5, 2000), np.full(200_000, 5.0))), "up@bench", PERIOD)
    axis.at(5.0)
    for word, key in (("release", "somebody"), ("nonsense", "bench"), ("claim", "a\nb")):
        axis.claim(key, word)
    lab.wait(lambda: len(axis.refusals("claim")) == 2, "two refusals")
    assert axis.holders[-1].data == "bench"
    axis.claim("bench", "release")
    axis.held_by("")
    axis.at(0.0)
    assert axis.samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    lab.send([0.0, 0.0], "late@bench", PERIOD)
    lab.wait(lambda: axis.refusals("late"), "a command of who holds nothing")
    assert "not claimed by bench" in axis.refusals("late")[0]


@pytest.mark.soak
def test_an_owner_that_stood_still_is_informed_that_its_claim_has_ended(lab):
    axis = Axis(lab)
    identification = Identification(lab)
    identification.begin()
    identification.process.signal(signal.SIGSTOP)
    axis.held_by("")
    identification.process.signal(signal.SIGCONT)
    # shared memory may take who stood still for dead, and bring it nothing for half a minute
    assert "claim" in identification.await_state("failed", timeout=120.0).message
    lab.wait(lambda: all((b.voltage == 0.0).all() for b in axis.samples.blocks[-20:]), "the safe voltage")
    assert identification.process.is_running
