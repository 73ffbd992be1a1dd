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

"""`ros2 bag` of a ROS 2 installation: it records running nodes, and what it plays is predicted."""

import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis import recording
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES

from .lab import DEEP

pytest.importorskip("rosbag2_py", reason="no wheels of rosbag2 exist; runs on a ROS 2 installation")
pytest.importorskip("launch_ros")

pytestmark = pytest.mark.nodes

ROOT = Path(__file__).parents[2]
PERIOD = 2e-5


def ros2(lab, *words):
    environment = {**os.environ, "ROS_DOMAIN_ID": str(lab.domain), "ROS_LOG_DIR": str(lab.folder)}
    return subprocess.Popen(["ros2", *map(str, words)], env=environment, stdin=subprocess.DEVNULL)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_what_rosbag2_records_is_read_whole_and_predicted_from_its_first_sample_when_it_is_played(lab, storage):
    lab.driver()
    live = lab.streaming()
    statuses = lab.statuses()
    bag, qos = lab.folder / "bag", ROOT / "config" / "record_qos.yaml"
    recorder = ros2(lab, "bag", "record", "-a", "-s", storage, "--qos-profile-overrides-path", qos, "-o", bag)
    lab.wait(lambda: lab.node.count_subscribers("samples") > 1, "the recorder")
    lab.pause(0.5)
    voltage = 2.0 - 2.0 * np.cos(2 * np.pi * 5.0 * PERIOD * np.arange(50_000))
    lab.send(voltage, "sine")
    lab.wait(lambda: "done" in lab.states(statuses, "sine"), "the end of the sine")
    lab.pause(0.5)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(60.0) == 0
    (sine,) = recording.read(bag)
    part = live.so_far()
    inside = part.phase == 1
    assert sine.voltage.size == voltage.size
    np.testing.assert_array_equal(sine.voltage, part.voltage[inside])
    np.testing.assert_array_equal(sine.displacement, part.displacement[inside])

    played, predicted = lab.samples("replay/samples"), lab.listen(PointCloud2, "replay/predicted_samples", DEEP)
    model = f"model_file:={ROOT / 'config' / 'published_stage.yaml'}"
    launched = ros2(lab, "launch", "piezo_hysteresis", "replay.launch.py", f"bag:={bag}", model)
    assert launched.wait(120.0) == 0
    clouds = [from_cloud(cloud, PREDICTED_SAMPLES) for cloud in predicted]
    index, residual = (np.concatenate([cloud[name] for cloud in clouds]) for name in ("index", "residual"))
    np.testing.assert_array_equal(index, played.index[-index.size :])
    assert index.size >= played.index.size - 500, "all but the block from which the sample period is known"
    assert np.sqrt(np.mean(residual**2)) < 30e-9, "the noise of the sensor"
