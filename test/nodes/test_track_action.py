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

"""A path as an action, where the package of the actions is built; the topic does the same without it."""

import numpy as np
import pytest

pytest.importorskip("piezo_hysteresis_interfaces", reason="needs the package of the actions, built by colcon")
from action_msgs.msg import GoalStatus
from piezo_hysteresis_interfaces.action import Track

from .goal import Goal, assert_granted
from .test_compensation_node import NODE, STROKE, Compensation, scan

pytestmark = pytest.mark.nodes


def track(lab, wanted, phase="path"):
    return Goal(lab, Track, f"{NODE}/track", displacement=list(map(float, wanted)), phase=phase)


def test_a_path_is_followed_refused_and_cancelled_by_action(lab):
    node = Compensation(lab)
    played = track(lab, scan())
    done = played.result()
    assert done.status == GoalStatus.STATUS_SUCCEEDED, done.result.message
    assert done.result.success
    assert 0.0 < done.result.rms < 0.004 * STROKE
    assert 0.0 < done.result.expected < 0.004 * STROKE
    assert {"planning", "playing"} <= {f.state for f in played.feedback}
    assert {f.phase for f in played.feedback} == {"path"}

    for wanted, reason in ((scan(0.2, 1.6), "not reachable"), ([np.nan], "finite"), ([], "at least one")):
        refused = track(lab, wanted).result()
        assert refused.status == GoalStatus.STATUS_ABORTED
        assert reason in refused.result.message

    long = track(lab, scan(duration=5.0))
    lab.wait(lambda: node.samples.newest.voltage[-1] > 1.0, "the scan to begin")
    busy = track(lab, scan()).result()
    assert busy.status == GoalStatus.STATUS_ABORTED
    assert busy.result.message.startswith("busy")
    assert not long.results, "the refusal of another path ends no goal"
    long.cancel()
    ended = long.result()
    assert_granted(lab, NODE)
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert not ended.result.success
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")
