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

"""A goal of an action never keeps its node from ending, and the actions go on after a fault."""

import sys
import threading
from types import SimpleNamespace

import pytest

from piezo_hysteresis.nodes.runtime import job_actions
from piezo_hysteresis.nodes.runtime.job_actions import JobActions

pytestmark = pytest.mark.nodes


class Handle:
    """A goal, and what became of it."""

    request, is_cancel_requested, state = None, False, ""

    def abort(self):
        self.state = "aborted"


def main_node(executor):
    """A node whose executor takes tasks and does not spin any more, or that has none yet."""
    return SimpleNamespace(
        executor=executor,
        context=SimpleNamespace(ok=lambda: True),
        guarded=lambda action: action,
        get_name=lambda: "node",
    )


@pytest.mark.parametrize("executor", [None, SimpleNamespace(create_task=lambda task: None)], ids=["none", "ended"])
def test_a_goal_that_never_begins_ends_with_its_node(executor):
    actions, handle, results = JobActions(main_node(executor), {}, lambda: None, ("done",)), Handle(), []
    kind = SimpleNamespace(Result=SimpleNamespace)
    goal = threading.Thread(target=lambda: results.append(actions._execute("identify", kind, handle)), daemon=True)
    goal.start()
    actions.end()
    goal.join(30.0)
    assert not goal.is_alive()
    assert handle.state == "aborted"
    assert results[0].message == "node ends"


def test_a_fault_of_the_executor_does_not_end_the_actions(lab, monkeypatch):
    """The types of the actions are not needed for this, so that any module stands in for them."""
    raised = threading.Event()

    class Faulty(job_actions.MultiThreadedExecutor):
        """An executor that fails once."""

        def _spin_once_impl(self, *arguments):
            if not raised.is_set():
                raised.set()
                raise RuntimeError("taking a message failed")
            super()._spin_once_impl(*arguments)

    monkeypatch.setattr(job_actions, "MultiThreadedExecutor", Faulty)
    monkeypatch.setattr(job_actions, "INTERFACES", "types_of_a_test")
    monkeypatch.setattr(job_actions, "find_spec", lambda name: True)
    monkeypatch.setitem(sys.modules, "types_of_a_test.action", SimpleNamespace())
    faults = []
    monkeypatch.setattr(lab.node, "fault", faults.append)
    actions = JobActions(lab.node, {}, lambda: None, ("done",))
    lab.wait(lambda: faults, "the report of the fault")
    (thread,) = (thread for thread in threading.enumerate() if thread.name == "actions")
    assert thread.is_alive()
    actions.end()
    thread.join(30.0)
    assert not thread.is_alive()
