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

"""`piezo follow` shows what the identification node does, and ends with its job."""

import sys

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from piezo_hysteresis.nodes.messages.conversions import diagnostic
from piezo_hysteresis.nodes.runtime.qos import STATUS

from .identification.test_identification_node import Identification

pytestmark = pytest.mark.nodes

FOLLOW = [sys.executable, "-m", "piezo_hysteresis.nodes.follow", "/"]


class Reporter:
    """Publishes what a node of an axis reports."""

    def __init__(self, lab, task):
        self._publisher = lab.node.create_publisher(DiagnosticStatus, "status", STATUS)
        self._name = f"{task}_node: {task}"

    def report(self, state, **values):
        self._publisher.publish(diagnostic(DiagnosticStatus.OK, self._name, f"it is {state}", state=state, **values))


def test_a_job_is_followed_to_its_end(lab):
    identification = Identification(lab)
    lab.wait(lambda: identification.ask("identify").success, "the identification node")
    identification.await_state("waiting")
    program = [sys.executable, "-m", "piezo_hysteresis.cli.main", "follow", "/"]
    follow = lab.start("piezo", program=program)
    lab.wait(lambda: "waiting" in follow.output, "the state under way")
    assert identification.ask("abort").success
    assert follow.wait() == 1
    assert "aborted" in follow.output.splitlines()[-1]


def test_without_a_job_it_follows_until_it_is_interrupted(lab):
    Identification(lab).await_state("idle")
    follow = lab.start("piezo", program=FOLLOW)
    lab.wait(lambda: "idle" in follow.output, "the state")
    assert follow.is_running


def test_a_namespace_without_a_node_is_reported(lab):
    follow = lab.start("piezo", program=[sys.executable, "-m", "piezo_hysteresis.nodes.follow", "/absent"])
    lab.wait(lambda: "no message on /absent/status yet" in follow.output, "the message")


def test_what_the_compensation_node_reports_neither_ends_it_nor_hides_the_end(lab):
    """A refused trajectory ended it with 1 in the middle of an identification."""
    identification, compensation = (Reporter(lab, task) for task in ("identification", "compensation"))
    identification.report("running", goal="1")
    compensation.report("planned", phase="scan")
    follow = lab.start("piezo", program=FOLLOW)
    lab.wait(lambda: "it is running" in follow.output, "the state of the identification")
    for state in ("refused", "planning", "playing", "done", "stopped"):
        compensation.report(state, phase="scan")
    lab.pause(0.5)
    assert follow.is_running and "compensation" not in follow.output
    identification.report("done", goal="1")
    for number in range(50):
        compensation.report("refused", phase=f"scan_{number}")
    assert follow.wait() == 0


def test_a_job_that_had_ended_before_does_not_end_it(lab):
    identification = Reporter(lab, "identification")
    for goal in ("1", "2"):
        for state in ("running", "fitting", "failed"):
            identification.report(state, goal=goal)
    follow = lab.start("piezo", program=FOLLOW)
    lab.wait(lambda: "it is failed" in follow.output, "the last state")
    lab.pause(0.5)
    assert follow.is_running
    identification.report("running", goal="3")
    identification.report("done", goal="3")
    assert follow.wait() == 0
