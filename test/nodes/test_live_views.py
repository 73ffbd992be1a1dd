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

"""The shipped layouts of PlotJuggler and Foxglove show topics and fields that the nodes really publish."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from piezo_hysteresis.acquisition.sample_block import Delivery, SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.driver.publishers import DriverTopics
from piezo_hysteresis.nodes.model.publishers import ModelTopics, Predicted
from piezo_hysteresis.nodes.topics import TOPICS
from piezo_hysteresis.online.predictor import Predictor

CONFIG = Path(__file__).parents[2] / "config"
AXIS = "/stage_x/"
PERIOD = 1e-3


@pytest.fixture(scope="module")
def published():
    """One message of every live topic with several fields, from the publishers of the nodes themselves."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=101)
    node = LifecycleNode("live_views", namespace="/stage_x", context=context)
    node.declare_parameter("live_rate", 50.0)
    driver, model = DriverTopics(node, "stage", "stage_x", PERIOD, 50.0), ModelTopics(node)
    heard: dict[str, JointState] = {}
    for topic in ("live", "predicted_live"):
        node.create_subscription(JointState, topic, lambda message, topic=topic: heard.setdefault(topic, message), 10)
    node.trigger_configure()
    node.trigger_activate()
    n = 100
    u = np.linspace(0.0, 1.0, n)
    index = np.arange(n, dtype=np.uint32)
    block = SampleBlock(0, PERIOD * index, u, 1e-6 * u, index, np.zeros(n, dtype=np.uint32), "stage")
    predictor = Predictor(PERIOD, Model((BoucWen(), Arx(b=[0.2])), PERIOD, displacement_scale=1e-4))
    driver.deliver(Delivery(block, 0, ()))
    answer = predictor.predict(0, 0, block.voltage, block.displacement)
    results = {"prediction": answer.prediction, "residual": answer.residual}
    model.publish(Predicted(block, results, 0, answer.warming_up, predictor.residual_rms), n, PERIOD)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    for _ in range(200):
        if len(heard) == 2:
            break
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)
    return heard


def check(topic: str, field: str, published: dict[str, JointState]) -> None:
    """`field` as ``data``, ``position[i]`` or ``name/position``."""
    assert topic.startswith(AXIS)
    kind = TOPICS[topic.removeprefix(AXIS)].type
    if kind is Float64:
        assert field == "data"
        return
    assert kind is JointState
    message = published[topic.removeprefix(AXIS)]
    named, by_number = re.fullmatch(r"(\w+)/position", field), re.fullmatch(r"position\[(\d+)\]", field)
    assert named or by_number
    assert len(message.position) == len(message.name)
    assert named[1] in message.name if named else int(by_number[1]) < len(message.name)


def test_plotjuggler_shows_what_is_published(published):
    root = ET.parse(CONFIG / "plotjuggler.xml").getroot()
    curves = [c.get(key) for c in root.iter("curve") for key in ("curve_x", "curve_y") if c.get(key)]
    curves += [c.get("name") for c in root.iter("curve") if not c.get("curve_x")]
    assert len(curves) >= 10
    topics = set(root.find("Plugins/plugin/selected_topics").get("value").split(";"))
    for curve in curves:
        topic, field = re.fullmatch(r"(/stage_x/\w+)/(.+)", curve).groups()
        assert topic in topics
        check(topic, field, published)


def test_plotjuggler_finds_the_series_of_its_loops_when_it_loads_the_layout():
    """It prepares the curves of one level of splitters by their names, and drops a loop without its two."""
    root = ET.parse(CONFIG / "plotjuggler.xml").getroot()
    prepared = {c.get("name") for c in root.findall("tabbed_widget/Tab/Container/DockSplitter/DockArea/plot/curve")}
    curves = list(root.iter("curve"))
    assert {c.get(key) for c in curves for key in ("curve_x", "curve_y") if c.get(key)} <= prepared
    assert {c.get("name") for c in curves if not c.get("curve_x")} <= prepared
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.get("count")) == len(splitter) == len(splitter.get("sizes").split(";"))


def test_foxglove_shows_what_is_published(published):
    layout = json.loads((CONFIG / "foxglove.json").read_text())
    panels = layout["configById"]
    paths = [p["value"] for panel in panels.values() for p in panel.get("paths", [])]
    paths += [panel["xAxisPath"]["value"] for panel in panels.values() if "xAxisPath" in panel]
    assert len(paths) >= 8
    for path in paths:
        topic, _, field = path.partition(".")
        check(topic, field, published)
    assert panels["RawMessages!status"]["topicPath"].removeprefix(AXIS) in TOPICS
    assert panels["DiagnosticSummary!all"]["topicToRender"] in TOPICS


def test_foxglove_numbers_mean_what_their_labels_say(published):
    layout = json.loads((CONFIG / "foxglove.json").read_text())
    meant = {"drive": "voltage", "measured": "displacement", "predicted": "prediction", "residual": "residual"}
    for panel in layout["configById"].values():
        for path in panel.get("paths", []):
            topic, _, field = path["value"].partition(".")
            number = re.fullmatch(r"position\[(\d+)\]", field)
            if number:
                assert published[topic.removeprefix(AXIS)].name[int(number[1])] == meant[path["label"]]


def test_every_panel_of_foxglove_is_in_its_layout():
    layout = json.loads((CONFIG / "foxglove.json").read_text())

    def leaves(tree):
        return [tree] if isinstance(tree, str) else leaves(tree["first"]) + leaves(tree["second"])

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_a_recorder_with_the_qos_file_receives_every_message():
    profiles = yaml.safe_load((CONFIG / "record_qos.yaml").read_text())
    assert {name for name, topic in TOPICS.items() if not is_live(topic.quality)} <= {n[1:] for n in profiles}
    assert "/command" in profiles
    for name, profile in profiles.items():
        quality = TOPICS[name[1:]].quality
        assert profile["history"] == "keep_last"
        assert profile["depth"] >= 10 * quality.depth or profile["durability"] == "transient_local"
        assert profile["reliability"] == "reliable"
        latched = quality.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert profile["durability"] == ("transient_local" if latched else "volatile")


def is_live(quality):
    """Scalars for the eye, and what goes without latching: the recorder's own depth will do."""
    return quality.depth == 10 and quality.durability != DurabilityPolicy.TRANSIENT_LOCAL
