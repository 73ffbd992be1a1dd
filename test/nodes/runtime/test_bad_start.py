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

"""A node that cannot start says why in one line, and its exit status is 2."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.nodes


@pytest.mark.parametrize(
    ("executable", "arguments", "reason"),
    [
        ("driver_node", ["--bogus"], "--bogus"),
        ("compensation_node", ["-p", "model_file:=pipe"], "expected a regular file"),
        ("compensation_node", ["-p", "driver:=/stage_x/driver_node"], "driver: got '/stage_x/driver_node', expected"),
        ("identification_node", ["-p", "driver:=a b"], "driver: got 'a b', expected the name of a node"),
        ("identification_node", ["-p", "experiment_root:=~no_such_user/x"], "there is no home folder of that user"),
    ],
    ids=["unknown argument", "pipe as model file", "path as driver", "no name as driver", "home of nobody"],
)
def test_a_bad_argument_is_refused_in_one_line(lab, monkeypatch, executable, arguments, reason):
    os.mkfifo(lab.folder / "pipe")
    monkeypatch.chdir(lab.folder)
    node = lab.start(executable, *arguments, fresh=True)
    assert node.wait() == 2
    (line,) = (line for line in node.output.splitlines() if "compiling kernels" not in line)
    assert reason in line


@pytest.mark.parametrize(("error", "status"), [("PiezoError('no model')", 2), ("KeyboardInterrupt", 130)])
def test_the_nodes_before_one_that_cannot_start_are_ended(error, status):
    """Their threads and locks; the last one first, while they can still publish."""
    program = f"""
import sys
from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.nodes.runtime.process import NodeLife, run_together

def fails():
    raise {error}

def end(node):
    print(node.get_name(), node.context.ok())

lives = [NodeLife(lambda name=name: GuardedNode(name), end=end) for name in ("first", "second")]
sys.exit(run_together([*lives, NodeLife(fails, end=end)]))
"""
    ended = subprocess.run([sys.executable, "-c", program], timeout=60.0, capture_output=True, text=True, check=False)
    assert ended.returncode == status, ended.stderr
    assert ended.stderr == ("no model\n" if status == 2 else "")
    assert ended.stdout.splitlines() == ["second True", "first True"]
