"""`Goal`: one goal of an action, for the tests of the nodes that serve them."""

import threading

from rclpy.action import ActionClient


class Goal:
    """One goal of a node: its feedback, and its result once it is there."""

    def __init__(self, lab, kind, name, **fields):
        self.lab, self.feedback, self.results = lab, [], []
        self._client = ActionClient(lab.node, kind, name)
        lab.wait(self._client.server_is_ready, f"the action {name}", 30.0)
        self._accepted = threading.Event()
        self._client.send_goal_async(kind.Goal(**fields), lambda m: self.feedback.append(m.feedback)).add_done_callback(
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
