"""A path as an action, where the package of the actions is built; the topic does the same without it."""

import numpy as np
import pytest

pytest.importorskip("piezo_hysteresis_interfaces", reason="needs the package of the actions, built by colcon")
from action_msgs.msg import GoalStatus
from piezo_hysteresis_interfaces.action import Track

from .goal import Goal
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

    for wanted, reason in ((scan(0.2, 1.6), "out of reach"), ([np.nan], "finite"), ([], "at least one")):
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
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert not ended.result.success
    lab.wait(lambda: abs(node.samples.newest.voltage[-1]) < 1e-3, "the safe voltage")
