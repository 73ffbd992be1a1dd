"""Identification as an action, where the package of the actions is built; the services do the same without it."""

import signal
import threading

import pytest

pytest.importorskip("piezo_hysteresis_interfaces", reason="needs the package of the actions, built by colcon")
from action_msgs.msg import GoalStatus
from piezo_hysteresis_interfaces.action import Diagnose, Identify
from rclpy.action import ActionClient

from .test_identification_node import DRIVER, Identification

pytestmark = pytest.mark.nodes


class Goal:
    """One goal of the identification node: its feedback, and its result once it is there."""

    def __init__(self, lab, kind, name):
        self.lab, self.feedback, self.results = lab, [], []
        self._client = ActionClient(lab.node, kind, f"identification_node/{name}")
        lab.wait(self._client.server_is_ready, f"the action {name}", 30.0)
        self._accepted = threading.Event()
        self._client.send_goal_async(kind.Goal(), lambda m: self.feedback.append(m.feedback)).add_done_callback(
            self._on_accepted
        )

    def _on_accepted(self, future):
        self.handle = future.result()
        self.handle.get_result_async().add_done_callback(lambda done: self.results.append(done.result()))
        self._accepted.set()

    def result(self, timeout=60.0):
        self.lab.wait(lambda: self.results, "the result", timeout)
        return self.results[0]

    def cancel(self):
        self._accepted.wait(10.0)
        self.handle.cancel_goal_async()


def test_goals_are_refused_followed_and_cancelled(lab):
    lab.driver(**DRIVER)
    identification = Identification(lab)
    nothing = Goal(lab, Diagnose, "diagnose").result()
    assert nothing.status == GoalStatus.STATUS_ABORTED
    assert nothing.result.message.startswith("no experiment")
    lab.wait(lambda: identification.ask("plan").success, "the driver's limits")
    goal = Goal(lab, Identify, "identify")
    identification.await_state("running")
    lab.wait(lambda: any(f.phase for f in goal.feedback), "feedback with a phase")
    busy = Goal(lab, Identify, "identify").result()
    assert busy.status == GoalStatus.STATUS_ABORTED
    assert busy.result.message.startswith("busy")
    goal.cancel()
    ended = goal.result()
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert not ended.result.success
    assert "safe voltage" in ended.result.message


def test_a_goal_under_way_does_not_keep_the_node_from_ending(lab):
    identification = Identification(lab)
    goal = Goal(lab, Identify, "identify")
    lab.wait(lambda: goal.feedback, "feedback of a node that waits for a driver")
    identification.process.signal(signal.SIGINT)
    assert identification.process.wait() == 0
