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

"""The change watch of a running model node: no baseline, a baseline, a stage that changes, and a restart."""

import time
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.changes.recalibration_history import read_numbers
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import load, loads, save
from piezo_hysteresis.model.model_parameters import hash_number, model_hash
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES, samples_to_cloud
from piezo_hysteresis.nodes.runtime.qos import COMMAND, LATCHED, SAMPLES

from .lab import DEEP

pytestmark = pytest.mark.nodes

PERIOD, SIZE = 2e-3, 50
MODEL = Model((BoucWen(), Arx(a=[-0.6], b=[0.2])), PERIOD, displacement_scale=1e-5)


class Stage:
    """An endless sine in place of a driver; its gain and its drive can be made to change."""

    def __init__(self, lab):
        self.lab, self.count, self.gain, self.amplitude = lab, 0, 1.0, 2.5
        self.model, self.state = MODEL, MODEL.rest(3.5)
        self.noise = np.random.default_rng(5)
        self.samples = lab.publisher(PointCloud2, "samples", SAMPLES)

    def change(self, model):
        """Become another stage, from the state that this one is in."""
        self.model = model

    def play(self, seconds):
        for _ in range(round(seconds / PERIOD / SIZE)):
            index = np.arange(self.count, self.count + SIZE)
            u = 3.5 + self.amplitude * np.sin(2 * np.pi * 11.0 * PERIOD * index) * (index > 100)
            y, self.state = self.model.run(u, self.state)
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

    lab.wait(lambda: stage.play(0.5) or lab.call(Trigger, "model_node/baseline").success, "an accepted baseline")
    stage.play(22.0)
    lab.wait(lambda: stage.play(0.5) or any("no change" in s.message for s in list(reported)), "a baseline")
    assert list(tmp_path.glob("baseline_*.npz"))

    stage.gain = 1.005
    stage.play(8.0)
    lab.wait(lambda: stage.play(0.5) or any("has changed: gain" in s.message for s in list(reported)), "an alarm")
    alarm = next(s for s in list(reported) if "has changed: gain" in s.message)
    low, high = (float(values_of(alarm)[end]) for end in ("change_low", "change_high"))
    # The interval holds the truth 19 times in 20, and the samples that the alarm rests on differ from run to run.
    assert low - (high - low) / 2.0 < 0.005 < high + (high - low) / 2.0
    assert high - low < 0.1 * 0.005
    lab.wait(
        lambda: any("has changed" in s.message for r in list(reports) for s in r.status), "the alarm on /diagnostics"
    )
    assert node.is_running

    stage.amplitude = 0.0
    changed = "the stage has changed: gain; "
    unknown, silent = f"{changed}the present drive was not part of the baseline", f"{changed}no prediction"
    lab.wait(lambda: stage.play(0.5) or reported[-1].message == unknown, "an alarm under a drive that is not known")
    assert reported[-1].level in (DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
    lab.wait(lambda: reported[-1].message.startswith(silent), "an alarm of a silent stage")
    assert reported[-1].level in (DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


def test_a_node_without_a_model_takes_no_baseline(lab):
    lab.start("model_node")
    lab.wait(lambda: lab.node.count_publishers("change") > 0, "the model node")
    answer = lab.call(Trigger, "model_node/baseline")
    assert not answer.success
    assert "give a model" in answer.message


def model_after(group):
    """The model of the stage after a change of a group, by another way than the recalibration's own."""
    values = MODEL.values()
    if group == "loop":
        return MODEL.with_values({"bouc_wen.A": 1.03 * values["bouc_wen.A"]})
    if group == "dynamics":
        return MODEL.with_values({"arx.delay": values["arx.delay"] + 0.05})
    return replace(MODEL, displacement_scale=1.005 * MODEL.displacement_scale)


@pytest.mark.parametrize(
    ("group", "parameter", "new"),
    [
        pytest.param("gain", "displacement_scale", 1.005e-5, marks=pytest.mark.soak),
        ("loop", "bouc_wen.A", 1.03 * MODEL.values()["bouc_wen.A"]),
        pytest.param("dynamics", "arx.delay", MODEL.values()["arx.delay"] + 0.05, marks=pytest.mark.soak),
    ],
)
def test_after_an_alarm_the_group_is_recalibrated_and_the_residual_is_back(lab, tmp_path, group, parameter, new):
    save(MODEL, tmp_path / "model.yaml")
    kept = tmp_path / "kept"
    reported = lab.listen(DiagnosticStatus, "change", COMMAND)
    tables, served = lab.listen(String, "recalibrations", LATCHED), lab.listen(String, "model", LATCHED)
    parameters = {"model_file": str(tmp_path / "model.yaml"), "baseline_folder": str(kept), "baseline_time": 20.0}
    lab.start("model_node", **parameters)
    lab.start("identification_node", experiment_root=str(tmp_path / "experiments"))
    stage = Stage(lab)
    predicted = lab.listen(PointCloud2, "predicted_samples", DEEP)
    lab.wait(lambda: lab.node.count_subscribers("samples") > 0, "the model node")
    lab.wait(lambda: lab.node.count_subscribers("recalibrated_model") > 0, "the identification node")
    lab.wait(lambda: stage.play(0.5) or any(s.hardware_id for s in list(reported)), "a prediction")
    assert "nothing to recalibrate" in refused(lab) or "no baseline" in refused(lab)
    lab.wait(lambda: stage.play(0.5) or lab.call(Trigger, "model_node/baseline").success, "an accepted baseline")
    lab.wait(lambda: stage.play(0.5) or any("no change" in s.message for s in list(reported)), "a baseline")
    assert "nothing to recalibrate" in refused(lab)
    stage.play(4.0)

    stage.change(model_after(group))
    lab.wait(lambda: stage.play(0.5) or f"has changed: {group}" in reported[-1].message, "an alarm")
    stage.play(12.0)
    plan = lab.call(Trigger, "model_node/plan_recalibration")
    assert plan.success
    assert f"{group} has changed" in plan.message
    assert lab.call(Trigger, "model_node/recalibrate").success
    lab.wait(lambda: stage.play(0.5) or "recalibrated on" in told(reported), "the recalibration")

    (number,) = read_numbers(lab.wait(lambda: tables[-1].data.count("\n") > 1 and tables[-1].data, "a table"), "topic")
    assert (number.group, number.parameter) == (group, parameter)
    assert number.low < new < number.high
    assert number.high - number.low < abs(new - number.old)
    assert number.residual_after < 1.1 * number.residual_baseline < number.residual_before
    assert read_numbers((kept / "recalibrations.csv").read_text(), "file") == (number,)
    (after,) = [load(path) for path in kept.glob("recalibrated_*.yaml")]
    assert model_hash(after) == number.model_after
    lab.wait(lambda: served and model_hash(loads(served[-1].data)) == number.model_after, "the model, from its owner")

    lab.wait(lambda: stage.play(0.5) or "no change" in reported[-1].message, "a silent watch")
    stage.play(8.0)
    newest = lab.wait(
        lambda: [c for c in predicted_clouds(predicted) if c["model"][0] == hash_number(after)], "its word"
    )
    residual = np.concatenate([c["residual"] for c in newest[-100:]])
    assert np.sqrt(np.mean(residual**2)) < 1.1 * 2e-9
    assert "no change" in reported[-1].message


def test_a_change_of_shape_needs_a_full_identification(lab, tmp_path):
    save(MODEL, tmp_path / "model.yaml")
    reported = lab.listen(DiagnosticStatus, "change", COMMAND)
    parameters = {"model_file": str(tmp_path / "model.yaml"), "baseline_folder": str(tmp_path), "baseline_time": 20.0}
    lab.start("model_node", **parameters)
    stage = Stage(lab)
    lab.wait(lambda: lab.node.count_subscribers("samples") > 0, "the model node")
    lab.wait(lambda: stage.play(0.5) or any(s.hardware_id for s in list(reported)), "a prediction")
    lab.wait(lambda: stage.play(0.5) or lab.call(Trigger, "model_node/baseline").success, "an accepted baseline")
    lab.wait(lambda: stage.play(0.5) or any("no change" in s.message for s in list(reported)), "a baseline")
    stage.change(
        MODEL.with_values(
            {"bouc_wen.gamma": 1.3 * MODEL.values()["bouc_wen.gamma"], "arx.a[0]": -0.9, "arx.b[0]": 0.05}
        )
    )
    lab.wait(lambda: stage.play(0.5) or "has changed" in reported[-1].message, "an alarm")
    stage.play(8.0)
    answer = lab.call(Trigger, "model_node/recalibrate")
    said = answer.message
    if answer.success:
        lab.wait(lambda: stage.play(0.5) or "refused" in told(reported), "a refusal")
        said = told(reported)
    assert "full identification" in said
    assert not list(tmp_path.glob("recalibrated_*"))


def refused(lab):
    answer = lab.call(Trigger, "model_node/recalibrate")
    assert not answer.success
    return answer.message


def told(reported):
    """What became of the last recalibration."""
    return values_of(reported[-1]).get("recalibration", "") if reported else ""


def predicted_clouds(samples):
    return [from_cloud(cloud, PREDICTED_SAMPLES) for cloud in list(samples)[-200:]]
