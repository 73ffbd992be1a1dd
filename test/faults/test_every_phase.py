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

"""Driver and identification node, killed and stopped at every moment of an identification.

What holds: the stage ends at its safe voltage with its slew kept at the wire, the run that was struck ends with the
reason, what was recorded is there, and what lives goes on and identifies again.
"""

import random
import signal

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from benchmarks.naming_cases import Case
from piezo_hysteresis.recording import write

from .campaign import BUSY, NODE, Campaign, ControllerAxis, SimulatedAxis, children

pytestmark = pytest.mark.nodes

KILL, STOP = signal.SIGKILL, signal.SIGSTOP
MOMENTS = ("waiting", "first phase", "between two phases", "later phase")
FITS = ("fit", "diagnose")
STOPPED = 6.0
"""Time for which a process stands still [s]: longer than a claim lasts."""


def strike_at(campaign, moment, process, number, chance):
    """Send a signal to a process at a moment of an identification; what was heard until then."""
    lab, samples = campaign.lab, campaign.samples

    def strike():
        process.signal(number)
        return samples.so_far()

    if moment == "between two phases":
        heard = []
        campaign.at_the_end_of_a_phase(lambda: heard.append(strike()) or True, chance.choice([2, 3, 4]))
        return heard[0]
    if moment == "waiting":
        assert campaign.ask("identify").success
        lab.pause(chance.uniform(0.0, 0.3))
    elif moment == "diagnose":
        diagnose(campaign)
    else:
        campaign.begin()
        if moment == "first phase":
            campaign.await_phase(1, 1.0)
        elif moment == "later phase":
            campaign.await_phase(6, 1.0)
        elif moment == "fit":
            campaign.await_state("fitting", timeout=240.0)
            lab.wait(lambda: children(campaign.node.pid), "the process of the fit")
        lab.pause(chance.uniform(0.0, 0.3))
    return strike()


def diagnose(campaign):
    """Begin the diagnosis of a recording that takes long."""
    recording = campaign.root / "0_poor"  # before all that the node records
    if not recording.exists():
        write(Case("poor", ("creep",), 0, 5e-4).experiment(), recording)
    request = SetParameters.Request(parameters=[Parameter("experiment", value=str(recording)).to_parameter_msg()])
    assert campaign.lab.call(SetParameters, f"{NODE}/set_parameters", request).results[0].successful
    assert campaign.ask("diagnose").success
    campaign.await_state("fitting")
    campaign.lab.wait(lambda: children(campaign.node.pid), "the process of the diagnosis")


def survive(campaign, moment, victim, number, chance):
    """One blow, and everything that must hold after it."""
    lab = campaign.lab
    process = campaign.driver if victim == "driver" else campaign.node
    moving = moment in ("first phase", "between two phases", "later phase")
    heard = strike_at(campaign, moment, process, number, chance)
    recording = campaign.newest_recording() if moving else None
    if number == STOP:
        lab.pause(STOPPED)
        if victim == "driver":
            campaign.axis.await_safe()
        process.signal(signal.SIGCONT)
    if victim == "driver" and number == KILL:
        process.wait()
        campaign.axis.await_safe()
        if moving:
            assert campaign.await_state("failed").message
        campaign.start_driver()
    elif victim == "driver" and campaign.axis.has_keeper:
        lab.wait(lambda: lab.state() == "unconfigured", "the driver to give up the stage that its keeper took")
        assert campaign.await_state("failed").message
        assert lab.transition("configure")
        assert lab.transition("activate")
    elif victim == "node" and number == KILL:
        process.wait()
        campaign.start_node()
    elif moving and victim == "node":
        assert "claim" in campaign.await_state("failed").message
    if moment in FITS and not (victim == "node" and number == KILL):
        campaign.await_state("done", timeout=240.0)
    elif victim == "driver" or number == STOP:
        lab.wait(lambda: campaign.state() not in BUSY, "the end of the run", 180.0)
    if recording:
        campaign.check_kept(recording, heard)
    campaign.await_limits()
    campaign.rests()


def goes_on(campaign):
    """An identification runs as before, and can be ended."""
    campaign.begin()
    assert campaign.ask("abort").success
    campaign.rests()
    campaign.check()


def test_driver_killed_and_node_stopped_between_two_phases(lab):
    campaign, chance = Campaign(lab), random.Random(0)
    campaign.await_limits()
    survive(campaign, "between two phases", "driver", KILL, chance)
    survive(campaign, "between two phases", "node", STOP, chance)
    goes_on(campaign)


@pytest.mark.soak
@pytest.mark.parametrize("number", [KILL, STOP], ids=["killed", "stopped"])
@pytest.mark.parametrize("victim", ["driver", "node"])
@pytest.mark.parametrize("moment", MOMENTS + FITS)
def test_at_every_moment_of_an_identification(lab, moment, victim, number):
    campaign, chance = Campaign(lab, SimulatedAxis), random.Random(f"{moment} {victim} {number}")
    campaign.await_limits()
    survive(campaign, moment, victim, number, chance)
    goes_on(campaign)


@pytest.mark.soak
@pytest.mark.device
@pytest.mark.parametrize("number", [KILL, STOP], ids=["killed", "stopped"])
@pytest.mark.parametrize("victim", ["driver", "node"])
@pytest.mark.parametrize("moment", MOMENTS)
def test_at_every_moment_on_a_controller_with_a_keeper(lab, moment, victim, number):
    campaign, chance = Campaign(lab, ControllerAxis), random.Random(f"{moment} {victim} {number}")
    try:
        campaign.await_limits()
        survive(campaign, moment, victim, number, chance)
        goes_on(campaign)
    finally:
        campaign.axis.close()
