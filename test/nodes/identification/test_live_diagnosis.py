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

"""`~/diagnose` with `live`: the node drives the stage until it knows, records one experiment, and can be aborted."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from piezo_hysteresis.discrepancy.choice.update import percent
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED
from piezo_hysteresis.recording import read
from piezo_hysteresis.report.json_file import read_json

pytestmark = pytest.mark.nodes

NODE = "identification_node"
DRIVER = {"sample_period": 1e-4, "block_duration": 0.05, "simulated__seed": 1}
PATIENCE = 400.0
"""Longest wait for a decision on a busy machine [s]."""


class LiveNode:
    """An identification node with `live`, and its status."""

    def __init__(self, lab, **parameters):
        self.lab, self.runs = lab, lab.folder / "runs"
        self.statuses = lab.listen(DiagnosticStatus, "status", LATCHED)
        lab.start(NODE, experiment_root=str(self.runs), live=True, **parameters)
        lab.wait(lambda: self.ask("plan").success, "the driver's limits")

    def ask(self, name):
        return self.lab.call(Trigger, f"{NODE}/{name}")

    def reaches(self, *states, timeout=60.0):
        def reached():
            return self.statuses and values_of(self.statuses[-1])["state"] in states

        self.lab.wait(reached, f"state {' or '.join(states)}, not {self.statuses[-1:]}", timeout)
        return self.statuses[-1]


def test_a_stage_is_driven_until_the_answer_is_certain(lab):
    lab.driver(**DRIVER, real_time_factor=10.0, simulated__environment__hum=2e-7)
    node = LiveNode(lab)
    assert "largest slew" in node.ask("plan").message
    assert not node.runs.exists(), "nothing moves before it is asked for"
    assert node.ask("diagnose").success
    status = node.reaches("done", "failed", timeout=PATIENCE)
    assert values_of(status)["state"] == "done", status.message
    assert values_of(status)["likely"].startswith("mains_hum ")
    (folder,) = node.runs.iterdir()
    answer = read_json(folder / "answer.json")
    named, share = next(iter(answer["live"]["probabilities"][-1]["probabilities"].items()))
    assert values_of(status)["likely"].startswith(f"{named} {percent(share)}"), "of the last decision"
    assert [e["name"] for e in answer["effects"]] == ["mains_hum"]
    played = sum(r.duration for r in read(folder).records)
    assert played == pytest.approx(answer["live"]["stage_time_s"], rel=0.02)
    assert (folder / "diagnosis.yaml").exists()
    off = Parameter(name="live", value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=False))
    lab.call(SetParameters, f"{NODE}/set_parameters", SetParameters.Request(parameters=[off]))
    assert node.ask("diagnose").success
    assert not values_of(node.reaches("fitting"))["likely"], "the probabilities belong to the diagnosis that drove"


def test_a_live_diagnosis_that_is_aborted_leaves_the_stage_safe_and_the_recording_readable(lab):
    lab.driver(**DRIVER, real_time_factor=1.0)
    voltages = lab.listen(Float64, "voltage")
    node = LiveNode(lab)
    assert node.ask("diagnose").success
    node.reaches("running")
    lab.wait(lambda: voltages and voltages[-1].data > 1.0, "the stage to move")
    assert node.ask("abort").success
    assert values_of(node.reaches("aborted"))["state"] == "aborted"
    lab.wait(lambda: voltages[-1].data == pytest.approx(0.0, abs=1e-6), "the safe voltage")
    (folder,) = node.runs.iterdir()
    assert read(folder).records
