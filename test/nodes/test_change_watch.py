"""The change watch of a running model node: no baseline, a baseline, a stage that changes, and a restart."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.messages.samples import samples_to_cloud
from piezo_hysteresis.nodes.runtime.qos import COMMAND, SAMPLES

pytestmark = pytest.mark.nodes

PERIOD, SIZE = 2e-3, 50
MODEL = Model((BoucWen(), Arx(a=[-0.6], b=[0.2])), PERIOD, displacement_scale=1e-5)


class Stage:
    """An endless sine in place of a driver; its gain can be made to change."""

    def __init__(self, lab):
        self.lab, self.count, self.state, self.gain = lab, 0, MODEL.rest(3.5), 1.0
        self.noise = np.random.default_rng(5)
        self.samples = lab.publisher(PointCloud2, "samples", SAMPLES)

    def play(self, seconds):
        for _ in range(round(seconds / PERIOD / SIZE)):
            index = np.arange(self.count, self.count + SIZE)
            u = 3.5 + 2.5 * np.sin(2 * np.pi * 11.0 * PERIOD * index) * (index > 100)
            y, self.state = MODEL.run(u, self.state)
            block = SampleBlock(
                1_000_000_000_000 + round(self.count * PERIOD * 1e9),
                PERIOD * np.arange(SIZE),
                u,
                self.gain * y + 2e-9 * self.noise.standard_normal(SIZE),
                index.astype(np.uint32),
                np.zeros(SIZE, np.uint32),
                "bench",
            )
            self.samples.publish(samples_to_cloud(block))
            self.count += SIZE
            time.sleep(0.004)


def test_a_stage_that_changes_is_reported_with_its_group(lab, tmp_path):
    save(MODEL, tmp_path / "model.yaml")
    reported = lab.listen(DiagnosticStatus, "change", COMMAND)
    reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
    parameters = {"model_file": str(tmp_path / "model.yaml"), "baseline_folder": str(tmp_path), "baseline_time": 20.0}
    node = lab.start("model_node", **parameters)
    stage = Stage(lab)
    lab.wait(lambda: lab.node.count_subscribers("samples") > 0, "the model node")
    lab.wait(lambda: any("no baseline" in s.message for s in list(reported)), "a first status")
    lab.wait(lambda: stage.play(0.5) or any(s.hardware_id for s in list(reported)), "a prediction")

    assert lab.call(Trigger, "model_node/baseline").success
    stage.play(22.0)
    lab.wait(lambda: stage.play(0.5) or any("no change" in s.message for s in list(reported)), "a baseline")
    assert list(tmp_path.glob("baseline_*.npz"))

    stage.gain = 1.005
    stage.play(8.0)
    lab.wait(lambda: stage.play(0.5) or any("has changed: gain" in s.message for s in list(reported)), "an alarm")
    alarm = next(s for s in list(reported) if "has changed: gain" in s.message)
    values = values_of(alarm)
    assert float(values["change_low"]) < 0.005 < float(values["change_high"])
    lab.wait(
        lambda: any("has changed" in s.message for r in list(reports) for s in r.status), "the alarm on /diagnostics"
    )
    assert node.is_running


def test_a_node_without_a_model_takes_no_baseline(lab):
    lab.start("model_node")
    lab.wait(lambda: lab.node.count_publishers("change") > 0, "the model node")
    answer = lab.call(Trigger, "model_node/baseline")
    assert not answer.success
    assert "give a model" in answer.message
