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

"""A command that has a stage makes it safe, whatever its terminal does."""

import subprocess
import sys

from ...paused_pipe import paused_pipe

PROGRAM = """
import os, signal, time
from piezo_hysteresis.cli import terminal
from piezo_hysteresis.cli.stage.safe_session import closed_safely

class Stage:
    def close(self):
        os._exit(3)

terminal.LINE_INTERVAL = 0.01
with closed_safely(Stage), terminal.progress("record"):
    time.sleep(1.0)  # for a line that nobody takes
    signal.raise_signal(signal.SIGINT)
"""


def test_an_interrupt_makes_the_stage_safe_while_the_terminal_is_paused():
    with paused_pipe() as (_, terminal):
        done = subprocess.run([sys.executable, "-c", PROGRAM], stderr=terminal, timeout=60.0, check=False)
    assert done.returncode == 3
