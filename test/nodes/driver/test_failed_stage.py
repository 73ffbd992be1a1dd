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

"""What a driver says about a command and about itself when its device fails, or does not answer any more."""

import sys

import numpy as np
import pytest

pytestmark = pytest.mark.nodes

PERIOD = 1e-3
FAULTY = """
import sys, time
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.nodes.driver.driver_node import main
from piezo_hysteresis.stage.simulated import SimulatedStage
exchange = SimulatedStage.exchange
def faulty(stage, voltage):
    if voltage.max() > 2.0:
        {fault}
    return exchange(stage, voltage)
SimulatedStage.exchange = faulty
sys.exit(main())
"""
"""Program of a driver whose device has a fault above 2 V."""


def rises_to_the_fault(lab, fault):
    """The statuses of a waveform that was played up to the fault, and the driver."""
    code = FAULTY.format(fault=fault)
    driver = lab.driver(program=[sys.executable, "-c", code], fresh=True, sample_period=PERIOD, ramp_rate=1000.0)
    samples, statuses = lab.streaming(), lab.statuses()
    lab.send(np.linspace(0.0, 3.0, 3000), "scan", PERIOD)
    lab.wait(lambda: samples.newest.voltage[-1] > 1.9, "the voltage of the fault")
    lab.pause(0.5)  # the samples of the fault are not published
    return driver, statuses


def test_a_command_that_a_fault_of_the_device_ends_is_reported_as_stopped(lab):
    _, statuses = rises_to_the_fault(lab, "raise StageError('the device is unplugged')")
    lab.wait(lambda: lab.states(statuses, "scan") == ["accepted", "playing", "stopped"], "the end of the command")
    assert statuses[-1].message == "the device is unplugged"
    lab.wait(lambda: lab.state() == "unconfigured", "the end of the failed stage")


def test_a_driver_whose_device_hangs_does_not_claim_safety_nor_use_it_again(lab):
    driver, statuses = rises_to_the_fault(lab, "time.sleep(3600.0)")
    reported = lab.diagnostics()
    lab.wait(lambda: any("has not returned for" in s.message for a in reported for s in a.status), "the hanging call")
    assert not lab.transition("deactivate")
    assert lab.state() == "unconfigured"
    lab.wait(lambda: any("voltage is unknown" in s.message for a in reported for s in a.status), "the reason")
    lab.wait(lambda: lab.states(statuses, "scan") == ["accepted", "playing", "stopped"], "the end of the command")
    assert statuses[-1].message == "a call of the stage does not return"
    assert not lab.transition("configure")
    lab.wait(lambda: f"is held by process {driver.pid}" in driver.output, "the refusal of a device that is in use")
    assert "is at its safe voltage" not in driver.output
