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
