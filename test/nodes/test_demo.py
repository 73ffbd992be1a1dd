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

"""The demo up to its first figures, and its end on every way out."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.nodes

ROOT = Path(__file__).parents[2]


@pytest.fixture
def demo(lab, tmp_path):
    """The demo as a process, and the lines it prints."""
    command = [sys.executable, ROOT / "examples" / "demo", "--seed", "3", "-o", tmp_path / "out"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(lab.domain), "ROS_LOG_DIR": str(tmp_path), "COLUMNS": "200"}
    output = (tmp_path / "demo.log").open("w+")
    process = subprocess.Popen(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
    yield process, lambda: (tmp_path / "demo.log").read_text()
    if process.poll() is None:
        process.terminate()
        process.wait(60.0)
    output.close()


def wait_for(pattern, process, text, timeout=90.0):
    deadline = time.monotonic() + timeout
    while not (found := re.search(pattern, text())):
        assert process.poll() is None and time.monotonic() < deadline, text()
        time.sleep(0.1)
    return found


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def nodes_of(process, text):
    found = wait_for(r"driver_node (\d+), model_node (\d+), identification_node (\d+)", process, text)
    return [int(pid) for pid in found.groups()]


def test_an_interrupted_demo_ends_its_nodes(demo):
    process, text = demo
    nodes = nodes_of(process, text)
    residual = wait_for(r"live residual +([\d.]+) nm rms .*paper", process, text)
    assert float(residual[1]) > 100.0  # this stage is not the one of the paper
    wait_for(r"plan: short: \d+ phases", process, text)
    process.send_signal(signal.SIGINT)
    assert process.wait(60.0) != 0
    assert "interrupted; the nodes have ended" in text()
    assert not any(is_running(pid) for pid in nodes)
    assert "hidden:" not in text()


def test_a_killed_demo_leaves_no_node_behind(demo):
    process, text = demo
    nodes = nodes_of(process, text)
    assert all(is_running(pid) for pid in nodes)
    process.kill()
    process.wait(10.0)
    deadline = time.monotonic() + 60.0
    while any(is_running(pid) for pid in nodes):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_node_that_dies_ends_the_demo_with_one_line(demo):
    process, text = demo
    nodes = nodes_of(process, text)
    os.kill(nodes[1], signal.SIGKILL)
    assert process.wait(90.0) != 0
    assert re.search(r"demo: model_node ended with code -9; the end of its log is in \S+model_node.log", text())
    assert not any(is_running(pid) for pid in nodes)
