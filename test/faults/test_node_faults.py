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

"""No message, no parameter and no fault of its own ends a node: it is reported, and the node goes on."""

import json
import sys

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED

pytestmark = pytest.mark.nodes

NODES = ("model_node", "identification_node", "compensation_node")
PERIOD = 2e-5
ODD_TIMES = (
    Time(sec=-(2**31)),
    Time(sec=-1, nanosec=2**32 - 1),
    Time(sec=2**31 - 1, nanosec=2**32 - 1),
    Time(sec=2**31 - 1, nanosec=999_999_999),
    Time(),
)


def set_parameter(lab, node, name, value):
    """Outcome of an attempt to set a parameter from outside."""
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return lab.call(SetParameters, f"{node}/set_parameters", request).results[0]


def newest(reports, node):
    """The newest status of a node on /diagnostics, or None."""
    return next((s for r in reversed(list(reports)) for s in r.status if s.name.startswith(node)), None)


def test_a_driver_never_follows_simulated_time(lab):
    driver = lab.driver(fresh=True, use_sim_time=True)
    assert driver.wait() == 2
    assert driver.output.strip().splitlines()[-1].startswith("use_sim_time: got true, expected false; a driver stamps")
    driver = lab.driver()
    samples = lab.streaming()
    clock = lab.node.create_publisher(Clock, "/clock", 10)
    answer = set_parameter(lab, "driver_node", "use_sim_time", True)
    assert not answer.successful
    assert "by the clock of the computer" in answer.reason
    for time in ODD_TIMES:
        clock.publish(Clock(clock=time))
    begin = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > begin + 50, "half a second of blocks")
    assert samples.newest.stamp > 1_600_000_000 * 10**9
    assert driver.is_running
    assert clock.get_subscription_count() == 0


def test_no_date_on_the_clock_ends_a_node_that_follows_it(lab):
    processes = [lab.start(node, use_sim_time=True) for node in NODES]
    reports = lab.diagnostics()
    lab.wait(lambda: all(newest(reports, node) for node in NODES), "the nodes")
    assert "no message arrives on /clock" in newest(reports, "model_node").message
    clock = lab.publisher(Clock, "/clock")
    lab.wait(lambda: clock.get_subscription_count() == len(NODES), "their clocks")
    for _ in range(100):
        for time in ODD_TIMES:
            clock.publish(Clock(clock=time))
        lab.pause(0.01)
    for node in NODES:
        lab.wait(
            lambda node=node: int(values_of(newest(reports, node))["faults"]) > 0, f"the fault of {node} to be reported"
        )
    clock.publish(Clock(clock=Time(sec=1000)))
    del reports[:]
    for node in NODES:
        lab.wait(lambda node=node: newest(reports, node), f"{node} to go on")
        assert not set_parameter(lab, node, "use_sim_time", False).successful
    assert all(process.is_running for process in processes)
    assert all(len(process.output) < 100_000 for process in processes)


def test_a_number_outside_its_range_is_refused_and_the_node_runs_on(lab):
    assert lab.start("identification_node", fresh=True, seed=-3).wait() == 2
    process = lab.start("identification_node")
    for name, value in (("seed", -3), ("seed", 2**62), ("seed", "3"), ("protocol", "nonsense")):
        answer = set_parameter(lab, "identification_node", name, value)
        assert not answer.successful
        assert answer.reason
    assert set_parameter(lab, "identification_node", "seed", 3).successful
    assert process.is_running


@pytest.mark.parametrize(("node", "name", "value"), [("compensation_node", "approach", 2.0), ("page_node", "port", 1)])
def test_a_start_parameter_that_is_set_later_is_refused(lab, node, name, value):
    process = lab.start(node, **({"port": 0} if node == "page_node" else {}))
    for odd, given in ((name, value), ("use_sim_time", True)):
        answer = set_parameter(lab, node, odd, given)
        assert not answer.successful
        assert answer.reason
    assert process.is_running


FAULTY = """
import sys
from piezo_hysteresis.nodes.identification import identification_node as node

def broken(limits, seed):
    raise ValueError("expected non-negative integer\\n[FATAL] forged")

node.PROTOCOLS.update(dict.fromkeys(node.PROTOCOLS, broken))
sys.exit(node.main(sys.argv[1:]))
"""


def test_a_fault_of_the_program_fails_only_the_request(lab):
    program = lab.folder / "faulty.py"
    program.write_text(FAULTY)
    lab.driver()
    process = lab.start("identification_node", program=[sys.executable, str(program)])
    statuses, reports = lab.listen(DiagnosticStatus, "status", LATCHED), lab.diagnostics()
    fault = "fault of this program: ValueError('expected non-negative integer"

    def plan():
        answer = lab.call(Trigger, "identification_node/plan")
        assert not answer.success
        return answer.message if answer.message.startswith("fault") else ""

    assert lab.wait(plan, "the limits of the driver").startswith(fault)
    for _ in range(2):
        del statuses[:]
        asked = lab.call(Trigger, "identification_node/identify")
        if asked.success:
            lab.wait(lambda: statuses and values_of(statuses[-1])["state"] == "failed", "the end of it")
            assert statuses[-1].message.startswith(fault)
        else:
            assert asked.message.startswith(fault)
    lab.wait(lambda: any(fault in s.message for r in list(reports) for s in r.status), "the fault on /diagnostics")
    assert process.is_running
    assert "\n[FATAL] forged" not in process.output


@pytest.mark.parametrize("topic", ["model", "command_status"])
def test_texts_of_others_forge_no_line(lab, topic):
    """Control characters in a model's text, in names and values: nothing of it reaches a log or a terminal as it is."""
    nodes = [lab.driver(), *(lab.start(node) for node in NODES)]
    evil = "x\x1b]0;title\x07\r\n[ERROR] [1.0] [driver_node]: forged\u202e"
    reports = lab.diagnostics()
    if topic == "model":
        publisher = lab.publisher(String, topic, LATCHED)
        model = dumps(Model((BoucWen(), Arx()), 1e-4)).replace('"bouc_wen"', json.dumps(evil))
        for text in (evil, f"{{a: [{evil}", model):
            publisher.publish(String(data=text))

        def refused():
            reported = newest(reports, "model_node")
            return reported is not None and "forged" in reported.message

        lab.wait(refused, "the refusal on /diagnostics")
    else:
        lab.streaming()
        statuses = lab.statuses()
        lab.send([0.0, 0.1, 0.0], evil)
        lab.publisher(PointCloud2, "trajectory").publish(command_to_cloud([0.0, 0.1, 0.0], PERIOD, evil))
        lab.wait(lambda: "refused '" in nodes[-1].output, "the refusal of a trajectory")
        lab.wait(lambda: any("refused" in lab.states(statuses, s.name) for s in list(statuses)), "the refusal")
        assert all(s.name.isprintable() and s.message.isprintable() for s in statuses)
    lab.pause(1.0)
    for report in list(reports):
        for status in report.status:
            assert status.message.isprintable(), status
            assert all(pair.value.isprintable() for pair in status.values)
    for process in nodes:
        assert all(line.isprintable() for line in process.output.split("\n")), process.output
        assert process.is_running
