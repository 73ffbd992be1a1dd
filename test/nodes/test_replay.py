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

"""What was predicted live is predicted again from the bag, and nothing that is played back moves a stage."""

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.identification.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES
from piezo_hysteresis.nodes.runtime.qos import COMMAND_STATUS, DEEP
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.recording import Bag, read, write

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
MODEL = Model((BoucWen(), Arx(b=[0.24641])), PERIOD, displacement_scale=1e-4)
ROOT = Path(__file__).parents[2]


def states(statuses, name):
    return [values_of(status)["state"] for status in list(statuses) if status.name == name]


def by_index(clouds):
    """Prediction, residual and model by the index of the first sample of each block, and its stamp."""
    rows = {}
    for cloud in clouds:
        fields = from_cloud(cloud, PREDICTED_SAMPLES)
        stamp = (cloud.header.stamp.sec, cloud.header.stamp.nanosec)
        rows[int(fields["index"][0])] = (stamp, fields["prediction"], fields["residual"], fields["model"])
    return rows


def test_a_played_bag_gives_the_same_prediction_and_moves_nothing(lab):
    file = str(save(MODEL, lab.folder / "model.yaml"))
    live = lab.start("model_node", model_file=file)
    driver = lab.driver(sample_period=PERIOD, autostart=False)
    recorder = BagRecorder(lab.node, lab.folder / "bag")
    statuses = lab.statuses()
    assert lab.transition("configure")
    lab.wait(lambda: lab.node.count_publishers("predicted_samples") and lab.node.count_publishers("samples"), "nodes")
    time.sleep(1.0)  # matched, so that the bag and the model node begin with the same block
    assert lab.transition("activate")
    wave = 3.0 - 3.0 * np.cos(2 * np.pi * 5 * PERIOD * np.arange(10_000))
    lab.send(wave, "sine_5hz", PERIOD)
    lab.wait(lambda: "done" in states(statuses, "sine_5hz"), "the end of the sine")
    blocks = recorder.counts["samples"]
    lab.wait(lambda: recorder.counts["predicted_samples"] >= blocks, "its predictions")
    driver.end()
    live.end()
    lab.do(recorder.close)

    bag = Bag(lab.folder / "bag")
    messages = {name: list(bag.messages([name])) for name in ("/samples", "/predicted_samples", "/command")}
    recorded = by_index(deserialize_message(m.raw, PointCloud2) for m in messages["/predicted_samples"])
    assert len(messages["/command"]) == 1

    time.sleep(max(0.0, messages["/command"][0].time_ns * 1e-9 + 2.1 - time.time()))  # older than command_max_age
    lab.driver("-r", "command:=/command", namespace="/live", sample_period=PERIOD)
    lab.start("model_node", model_file=file, use_sim_time=True)
    refused = lab.listen(DiagnosticStatus, "/live/command_status", COMMAND_STATUS)
    voltage, reports = lab.listen(Float64, "/live/voltage"), lab.listen(DiagnosticArray, "/diagnostics")
    replayed = lab.listen(PointCloud2, "predicted_samples", DEEP)
    lab.wait(lambda: voltage and lab.node.count_publishers("predicted_samples"), "driver and model node")
    topics = ["/samples", "/phase", "/model", "/command"]
    path = os.pathsep.join(p for p in (str(ROOT), os.environ.get("PYTHONPATH", "")) if p)
    environment = {**os.environ, "ROS_DOMAIN_ID": str(lab.domain), "PYTHONPATH": path}
    subprocess.run(
        [
            sys.executable,
            str(ROOT / "examples" / "play_bag.py"),
            str(lab.folder / "bag"),
            "--rate",
            "2",
            "--topics",
            *topics,
        ],
        env=environment,
        check=True,
        timeout=60.0,
    )
    lab.wait(lambda: len(replayed) >= len(messages["/samples"]), "all predictions")
    again = by_index(replayed)
    assert set(recorded) <= set(again)
    for index, (stamp, *columns) in recorded.items():
        assert again[index][0] == stamp
        for live_values, values in zip(columns, again[index][1:], strict=True):
            np.testing.assert_array_equal(values, live_values)
    assert max(np.ptp(columns[1]) for columns in recorded.values()) > 1e-6

    lab.wait(lambda: states(refused, "sine_5hz") == ["refused"], "the refusal of the recorded command")
    assert "old" in refused[-1].message
    assert max(abs(message.data) for message in voltage) < 1e-3
    span = [messages["/samples"][i].time_ns * 1e-9 for i in (0, -1)]
    seconds = [
        a.header.stamp.sec for a in reports if a.status[0].name == "model_node: prediction" and a.header.stamp.sec
    ]
    assert seconds
    assert all(span[0] - 1 <= second <= span[1] + 1 for second in seconds)


@pytest.mark.parametrize("speed", [10, pytest.param(1, marks=pytest.mark.soak)])
def test_a_measured_record_is_predicted_live(lab, speed):
    """A real stage, 40 cycles at 1 Hz: fitted, replayed by the driver, predicted to 1 % over the last 30 cycles.

    Ten times as fast means a tenth of the sample period, for the record and for the model alike: all numbers of the
    model count samples (delay, pole) or no time at all (loop), so it is the same problem.
    """
    folder = Path(os.environ.get("PIEZO_DATA", ROOT.parent / "shared" / "data")) / "picma-p885"
    if not folder.is_dir():
        pytest.skip(f"no measured data in {folder}; set PIEZO_DATA")
    columns, units = {"voltage": 1, "displacement": 5}, {"displacement": "um"}
    file = folder / "Model_Vi_Do.dat"
    measured = read(file, columns=columns, units=units, sample_period=5e-3, initial_voltage=0.0)
    (record,) = measured
    fitted = identify(measured).model
    assert fitted["arx"].array("a").size == 1
    assert {effect.name for effect in fitted.effects} == {"bouc_wen", "arx", "offset"}

    period = record.sample_period / speed
    write(Experiment((replace(record, sample_period=period),)), lab.folder / "record")
    model = save(replace(fitted, sample_period=period), lab.folder / "model.yaml")
    lab.start("model_node", model_file=str(model), rms_time=30.0 / speed)
    rms, predicted = lab.listen(Float64, "residual_rms"), lab.listen(PointCloud2, "predicted_samples", DEEP)
    lab.wait(lambda: lab.node.count_publishers("predicted_samples"), "the model node")
    lab.driver(stage="replay", replay__experiment=str(lab.folder / "record"), replay__subscribers=1)
    last = record.size - 1

    def ended():
        return predicted and from_cloud(predicted[-1], PREDICTED_SAMPLES)["index"][-1] >= last

    lab.wait(ended, "the end of the record", 30.0 + record.duration / speed)
    rows = [from_cloud(cloud, PREDICTED_SAMPLES) for cloud in predicted]
    index, residual = (np.concatenate([row[name] for row in rows]) for name in ("index", "residual"))
    cycles = residual[(index > last - 30 * 200) & (index <= last)]
    assert cycles.size == 30 * 200
    limit = 0.01 * np.ptp(record.displacement)
    assert np.sqrt(np.mean(cycles**2)) <= limit
    live_step = round(1.0 / (50.0 * period))  # samples between two messages of `live_rate`
    assert rms[(last + 1) // live_step - 1].data <= limit, "when the record ended, not while its end is held"
