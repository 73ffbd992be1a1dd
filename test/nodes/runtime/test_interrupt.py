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

"""A node that is told to end while it starts ends."""

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.nodes


def test_an_interrupt_that_a_library_swallows_while_a_node_starts_still_ends_it():
    program = """
import signal
from piezo_hysteresis.nodes.runtime.interrupt import remember_interrupts

remember_interrupts()
try:
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    pass
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.nodes.runtime.process import run

raise SystemExit(run(lambda: GuardedNode("late")))
"""
    ended = subprocess.run([sys.executable, "-c", program], timeout=60.0, capture_output=True, text=True, check=False)
    assert ended.returncode == 128 + signal.SIGINT, ended.stderr
