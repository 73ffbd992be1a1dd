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

"""Identification as an action, where the package of the actions is built; the services do the same without it."""

import signal

import pytest

pytest.importorskip("piezo_hysteresis_interfaces", reason="needs the package of the actions, built by colcon")
from action_msgs.msg import GoalStatus
from piezo_hysteresis_interfaces.action import Diagnose, Identify

from ..goal import Goal, assert_granted
from .test_identification_node import DRIVER, Identification

pytestmark = pytest.mark.nodes


def test_goals_are_refused_followed_and_cancelled(lab):
    lab.driver(**DRIVER)
    identification = Identification(lab)
    nothing = Goal(lab, Diagnose, "identification_node/diagnose").result()
    assert nothing.status == GoalStatus.STATUS_ABORTED
    assert nothing.result.message.startswith("no experiment")
    lab.wait(lambda: identification.ask("plan").success, "the driver's limits")
    goal = Goal(lab, Identify, "identification_node/identify")
    identification.await_state("running")
    lab.wait(lambda: any(f.phase for f in goal.feedback), "feedback with a phase")
    busy = Goal(lab, Identify, "identification_node/identify").result()
    assert busy.status == GoalStatus.STATUS_ABORTED
    assert busy.result.message.startswith("busy")
    goal.cancel()
    ended = goal.result()
    assert_granted(lab, "identification_node")
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert not ended.result.success
    assert "safe voltage" in ended.result.message


def test_a_goal_under_way_does_not_keep_the_node_from_ending(lab):
    identification = Identification(lab)
    goal = Goal(lab, Identify, "identification_node/identify")
    lab.wait(lambda: goal.feedback, "feedback of a node that waits for a driver")
    identification.process.signal(signal.SIGINT)
    assert identification.process.wait() == 0
