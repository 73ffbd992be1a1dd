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

"""Two drivers never move one stage: the second one refuses to start as long as the first one lives."""

import signal
import sys

import numpy as np
import pytest
from diagnostic_msgs.msg import KeyValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import String

from piezo_hysteresis.nodes.runtime.qos import LATCHED

pytestmark = pytest.mark.nodes

IDEAL = {"simulated__electronics__dac_bits": 0.0, "ramp_rate": 20.0}


def on_another_machine(folder):
    """A driver that does not see the locks of this machine."""
    locks = folder / "other_machine"
    locks.mkdir()
    code = (
        f"import sys, pathlib; from piezo_hysteresis.acquisition import stage_lock; "
        f"stage_lock.FOLDERS = (pathlib.Path({str(locks)!r}),); "
        "from piezo_hysteresis.nodes.driver.driver_node import main; sys.exit(main())"
    )
    return [sys.executable, "-c", code]


@pytest.mark.parametrize("same_machine", [True, False])
def test_a_second_driver_refuses_until_the_first_is_gone(lab, same_machine, tmp_path):
    first = lab.driver(**IDEAL)
    samples, reported = lab.streaming(), lab.diagnostics()
    program = None if same_machine else on_another_machine(tmp_path)
    second = lab.driver("-r", "__node:=second", program=program, fresh=not same_machine, discovery_time=10.0, **IDEAL)
    lab.wait(
        lambda: any(s.name == "second: stage" and s.level == b"\x02" for a in reported for s in a.status), "an error"
    )
    assert ("is held by process" if same_machine else "published by another driver") in second.output
    assert lab.state("second") == "unconfigured"
    first.signal(signal.SIGINT)
    assert first.wait() == 0
    lab.wait(lambda: lab.node.count_publishers("samples") == 0, "the end of the first")
    blocks = len(samples.blocks)
    request = SetParametersAtomically.Request(parameters=[Parameter("discovery_time", value=0.1).to_parameter_msg()])
    assert lab.call(SetParametersAtomically, "second/set_parameters_atomically", request).result.successful
    assert lab.transition("configure", "second")
    assert lab.transition("activate", "second")
    lab.wait(lambda: len(samples.blocks) > blocks, "blocks of the second")


def test_a_driver_that_plays_from_the_memory_of_its_device_lives(lab, tmp_path):
    """It sends no block for a minute."""
    first = lab.driver(sample_period=0.01, simulated__memory=True, **IDEAL)
    statuses, reported = lab.statuses(), lab.diagnostics()
    lab.streaming()
    lab.send(np.sin(np.linspace(0, np.pi, 6000)), "long", 0.01)
    lab.wait(lambda: "accepted" in lab.states(statuses, "long"), "the waveform")
    second = lab.driver(
        "-r", "__node:=second", program=on_another_machine(tmp_path), fresh=True, discovery_time=10.0, **IDEAL
    )
    lab.wait(
        lambda: any(s.name == "second: stage" and s.level == b"\x02" for a in reported for s in a.status), "an error"
    )
    assert "published by another driver" in second.output
    assert lab.state("second") == "unconfigured"
    first.signal(signal.SIGINT)
    assert first.wait() == 0


def test_a_second_driver_ends_no_claim(lab):
    """It has no stage and so cannot say who holds it: a running identification ended when it came."""
    lab.driver(claim_timeout=600.0, **IDEAL)
    lab.streaming()
    holders, claims = lab.listen(String, "claimed_by", LATCHED), lab.publisher(KeyValue, "claim")
    claims.publish(KeyValue(key="bench", value="claim"))
    lab.wait(lambda: holders and holders[-1].data == "bench", "the claim")
    second = lab.driver("-r", "__node:=second", **IDEAL)
    lab.wait(lambda: "is held by process" in second.output, "the refusal")
    lab.wait(lambda: lab.node.count_publishers("claimed_by") == 2, "the second driver")
    claims.publish(KeyValue(key="bench", value="release"))
    lab.wait(lambda: holders[-1].data == "", "the release")
    claims.publish(KeyValue(key="other", value="claim"))
    lab.wait(lambda: holders[-1].data == "other", "the next claim")
    assert lab.state("second") == "unconfigured"
    shown = [message.data for message in holders]
    assert shown[shown.index("bench") :] == ["bench", "", "other"]
