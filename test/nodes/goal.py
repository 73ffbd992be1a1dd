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

import fnmatch
import threading
from pathlib import Path
from xml.etree import ElementTree

from rclpy.action import ActionClient

from piezo_hysteresis.nodes.runtime.job_actions import SUFFIX

POLICY = Path(__file__).parents[2] / "config" / "sros2_policy.xml"


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


def assert_granted(lab, node):
    """The rights of the security policy cover what the node uses that serves the actions of `node`."""
    (profile,) = ElementTree.parse(POLICY).getroot().iterfind(f".//profile[@node='{node}{SUFFIX}']")
    granted = {right: ["/" + name.text.lstrip("/") for name in kind] for kind in profile for right in kind.attrib}
    used = lab.node.get_service_names_and_types_by_node(node + SUFFIX, "/")
    jobs = {name.split("/_action/")[0] for name, _ in used if "/_action/" in name}
    assert jobs
    assert {name for name in jobs if any(fnmatch.fnmatch(name, p) for p in granted["execute"])} == jobs
    assert {name for name, _ in used if "/_action/" not in name} == set(granted["reply"])
    topics = {name for name, _ in lab.node.get_publisher_names_and_types_by_node(node + SUFFIX, "/")}
    assert {name for name in topics if "/_action/" not in name} <= set(granted["publish"])
