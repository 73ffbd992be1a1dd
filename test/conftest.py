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

"""Four processes share the tests file by file, so that none of them waits while another one still has many files.

Tests that start nodes wait most of their time. Three such files at once take less of the processors than two of them
beside a test that computes. Files that open an emulated device, whose lock one process at a time may have, stay in one
process, and so do those that open a browser, which draws with the processor.

Tests of real processes over DDS, or of a device that a keeper makes safe when its driver is late, need the processor in
time. One that fails is tried once more, and reported as RERUN: a promise that does not hold fails twice, a computer
that was busy elsewhere does not. Nor does it fail a property: no example has a deadline. The same holds for a test of
nodes in whose process a library crashes.

A shell starts a background job with SIGINT ignored, and nohup its command with SIGHUP ignored, and every process below
inherits that. Tests that send these signals need them to arrive.

Diagnoses use one core, because the processes of the tests share the cores already.
"""

import os
import signal

import pytest
from hypothesis import settings
from xdist.scheduler import LoadGroupScheduling

os.environ.setdefault("PYTHON_CPU_COUNT", "1")
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        nodes = item.get_closest_marker("nodes") is not None
        device = item.get_closest_marker("device") is not None
        browser = item.path.parent.name == "page"
        group = "devices" if device else "browsers" if browser else item.path.stem
        item.add_marker(pytest.mark.xdist_group(group))
        if nodes or device:
            item.add_marker(pytest.mark.flaky(reruns=1))


class Scheduler(LoadGroupScheduling):
    """Lets the other processes finish the tests of one that died; `LoadGroupScheduling` hangs or fails there."""

    def remove_node(self, node):
        """Take a process out; the test in which it died is tried again."""
        work = self.assigned_work[node]
        self.assigned_work[node] = {name: tests for name, tests in work.items() if not all(tests.values())}
        return super().remove_node(node)

    def mark_test_pending(self, item):
        """Nothing to do: the test has not been finished."""

    def _reschedule(self, node):
        """Give a process work; not to one that still collects the tests."""
        if node in self.registered_collections:
            super()._reschedule(node)


def pytest_xdist_make_scheduler(config: pytest.Config, log):
    return Scheduler(config, log)
