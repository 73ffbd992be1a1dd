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

"""The ten lines with which other lab software drives a stage, against a real driver."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import String

from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.runtime.qos import LATCHED

from .lab import _command

pytestmark = pytest.mark.nodes

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMESPACE = "/stage_x"


def run(lab, script, *arguments):
    """A script of the repository, or the executable that `ros2 run` finds."""
    program = [sys.executable, EXAMPLES / script] if script.endswith(".py") else [_command(script)[0]]
    command = [*program, *arguments, "--ros-args", "-r", f"__ns:={NAMESPACE}"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(lab.domain), "ROS_LOG_DIR": str(lab.folder)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=60)


def test_a_voltage_is_set(lab):
    lab.driver(namespace=NAMESPACE, ramp_rate=100.0, real_time_factor=5.0)
    samples = lab.streaming(f"{NAMESPACE}/samples")
    done = run(lab, "set_voltage", "3.5")
    assert done.returncode == 0, done.stderr
    lab.wait(lambda: abs(samples.newest.voltage[-1] - 3.5) < 1e-3, "3.5 V")


def test_a_waveform_is_played(lab):
    lab.driver(namespace=NAMESPACE, real_time_factor=5.0)
    samples = lab.streaming(f"{NAMESPACE}/samples")
    done = run(lab, "send_waveform.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "my_sine: done"
    lab.wait(
        lambda: samples.newest.phase[-1] != samples.blocks[0].phase[0] and samples.newest.voltage[-1] < 0.01, "its end"
    )
    assert samples.voltage.max() == pytest.approx(5.0, abs=1e-3)


def test_a_refused_waveform_is_reported(lab):
    lab.driver(namespace=NAMESPACE, voltage_max=4.0)
    done = run(lab, "send_waveform.py")
    assert done.returncode == 1
    assert "my_sine: refused, " in done.stdout
    assert "expected 0 to 4 V" in done.stdout


def test_the_outcome_of_an_earlier_waveform_is_not_taken(lab):
    lab.driver(namespace=NAMESPACE, real_time_factor=5.0, claim_timeout=120.0)
    lab.streaming(f"{NAMESPACE}/samples")
    assert run(lab, "send_waveform.py").returncode == 0
    holders = lab.listen(String, f"{NAMESPACE}/claimed_by", LATCHED)
    lab.publisher(KeyValue, f"{NAMESPACE}/claim").publish(KeyValue(key="another_lab", value="claim"))
    lab.wait(lambda: holders and holders[-1].data == "another_lab", "the claim")
    done = run(lab, "send_waveform.py")
    assert done.returncode == 1
    assert "my_sine: refused, " in done.stdout and "done" not in done.stdout


def test_a_scan_is_sent(lab):
    lab.driver(namespace=NAMESPACE, real_time_factor=2.0)
    statuses = lab.listen(DiagnosticStatus, f"{NAMESPACE}/status", LATCHED)
    model = Path(__file__).parents[2] / "config" / "published_stage.yaml"
    lab.start("compensation_node", namespace=NAMESPACE, model_file=str(model))
    lab.streaming(f"{NAMESPACE}/samples")
    lab.pause(3.0)  # the node looks for the driver twice a second
    done = run(lab, "send_scan.py")
    assert done.returncode == 0, done.stderr

    def done():
        return any(values_of(s)["state"] == "done" for s in list(statuses) if values_of(s)["phase"] == "my_scan")

    lab.wait(done, f"the scan to be done, not {statuses[-1:]}")
