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

"""A driver whose terminal is paused, or whose pipe nobody reads, obeys: a line of its log never stops the stage."""

import os
import signal
import subprocess
import sys

import pytest
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from ...paused_pipe import fill, paused_pipe

pytestmark = pytest.mark.nodes

PARAMETERS = {"simulated.electronics.dac_bits": 0.0, "ramp_rate": 20.0, "discovery_time": 0.1}


@pytest.fixture
def paused(lab):
    """A driver that holds 5 V and has since written a line that nobody takes, and its samples."""
    given = [part for name, value in PARAMETERS.items() for part in ("-p", f"{name}:={value}")]
    command = [sys.executable, "-m", "piezo_hysteresis.nodes.driver.driver_node", "--ros-args", *given]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(lab.domain), "ROS_LOG_DIR": str(lab.folder)}
    with paused_pipe(is_full=False) as (_, terminal):
        process = subprocess.Popen(command, env=environment, stdout=terminal, stderr=terminal)
        try:
            samples, level = lab.streaming(), lab.publisher(Float64, "set_voltage")
            level.publish(Float64(data=5.0))
            lab.wait(lambda: samples.newest.voltage[-1] == 5.0, "the set-point")
            refused = lab.statuses()
            fill(terminal)
            level.publish(Float64(data=50.0))
            yield process, samples, refused
        finally:
            process.kill()
            process.wait()


def test_samples_flow_and_a_stop_is_obeyed(lab, paused):
    _, samples, refused = paused
    lab.wait(lambda: any("50" in status.message for status in refused), "the refusal")
    blocks = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks after the line")
    assert lab.call(Trigger, "driver_node/stop").success
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")


def test_a_signal_ends_it_at_the_safe_voltage(lab, paused):
    process, samples, refused = paused
    lab.wait(lambda: any("50" in status.message for status in refused), "the refusal")
    process.send_signal(signal.SIGTERM)
    assert process.wait(60.0) == 0
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
