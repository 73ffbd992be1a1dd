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

"""The live page in a real browser, beside running nodes: what it shows is what they say, and its buttons act."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, diagnostic, values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES

from ..lab import DEEP

pytestmark = pytest.mark.nodes

ROOT = Path(__file__).parents[3]
PERIOD = 2e-5
AXIS = "/stage_x"


@pytest.fixture(scope="module")
def nodes(shared_lab, browser):
    """The nodes of an axis that is driven, and the page of it, open."""
    lab = shared_lab
    lab.driver(namespace=AXIS)
    lab.start("model_node", namespace=AXIS, model_file=str(ROOT / "config" / "published_stage.yaml"))
    lab.start("identification_node", namespace=AXIS, experiment_root=str(lab.folder / "experiments"))
    lab.others = list(lab.processes)
    page = lab.start("page_node", port=0)
    url = lab.wait(lambda: re.search(r"http://127\.0\.0\.1:\d+/", page.output), "the address of the page").group()
    lab.page = page
    lab.measured = lab.samples(f"{AXIS}/samples")
    lab.predicted = lab.listen(PointCloud2, f"{AXIS}/predicted_samples", DEEP)
    lab.health = lab.diagnostics()
    lab.wait(lambda: lab.measured.blocks and lab.predicted, "samples and predictions")
    browser.open(url)
    browser.wait(lambda: "idle" in browser.text("phase"), "the phase")
    return lab


def scan(lab, duration=60.0):
    """Drive the stage for a while."""
    time = PERIOD * np.arange(round(duration / PERIOD))
    publisher = lab.publisher(PointCloud2, f"{AXIS}/command")
    publisher.publish(command_to_cloud(4.0 * (1.0 - np.cos(2 * np.pi * 5.0 * time)), PERIOD, "scan"))


def test_the_page_draws_the_loop_and_its_points_are_those_of_the_topics(nodes, browser):
    scan(nodes)
    browser.wait(lambda: "scan" in browser.text("phase"), "the phase 'scan'")
    browser.wait(lambda: max(browser.loop()["voltage"], default=0.0) > 7.9, "the loop")
    browser.wait(lambda: known_share(browser.loop()["loop_predicted"]) > 0.9, "the prediction")
    browser.click("Pause")
    seen = nodes.measured.so_far()
    u, y, p = browser.loop().values()
    assert u.size > 300
    assert np.ptp(u) > 7.9
    heard = set(zip(seen.voltage.tolist(), (1e6 * seen.displacement).tolist(), strict=True))
    assert set(zip(u, y, strict=True)) <= heard
    clouds = [from_cloud(cloud, PREDICTED_SAMPLES) for cloud in nodes.predicted]
    said = {(1e6 * a, 1e6 * b) for c in clouds for a, b in zip(c["displacement"], c["prediction"], strict=True)}
    known = np.isfinite(p)
    assert known.sum() > 0.5 * u.size
    assert set(zip(y[known], p[known], strict=True)) <= said
    browser.click("Pause")


def test_the_page_node_loads_no_compiler(nodes):
    mapped = Path(f"/proc/{nodes.page.pid}/maps").read_text()
    assert "rclpy" in mapped
    assert "llvmlite" not in mapped


def test_the_page_fits_screens_telephones_and_paper(nodes, browser, pictures):
    for width in (1200, 420):
        browser.size(width, 900)
        browser.wait(lambda w=width: browser.value("document.scrollingElement.scrollWidth") <= w, f"{width} px")
        assert browser.picture(pictures / f"live_page_{width}.png").stat().st_size > 20_000
    browser.size(1200, 1000)
    assert browser.print(pictures / "live_page.pdf").stat().st_size > 20_000


def test_stop_stops_and_raises_an_alarm_and_release_asks_first(nodes, browser):
    browser.click("Stop")
    nodes.wait(lambda: nodes.measured.newest.voltage[-1] == 0.0, "the safe voltage")
    browser.wait(lambda: "stopped" in browser.text("alarms"), "the alarm")
    assert "stopped" in driver_report(nodes).message
    browser.click("Release …")
    browser.click("Do not")
    assert values_of(driver_report(nodes))["stopped"] == "True"
    browser.click("Release …")
    browser.click("Release")
    browser.wait(lambda: "stopped" not in browser.text("driver"), "the end of the stop")
    assert values_of(driver_report(nodes))["stopped"] == "False"


def known_share(values):
    """Share of numbers that are none of NaN."""
    return np.isfinite(values).mean() if values.size else 0.0


def driver_report(lab):
    """Newest report of the driver."""
    reports = [status for array in lab.health for status in array.status if status.name.endswith(": stage")]
    return reports[-1]


def test_identify_shows_the_plan_and_moves_nothing_before_it_is_confirmed(nodes, browser):
    nodes.wait(lambda: nodes.measured.newest.voltage[-1] == 0.0, "the safe voltage")
    plan = nodes.call(Trigger, f"{AXIS}/identification_node/plan").message
    browser.click("Identify …")
    browser.wait(lambda: plan in browser.text("question"), "the plan")
    assert nodes.measured.newest.voltage[-1] == 0.0
    browser.click("Identify")
    browser.wait(lambda: "recording to" in browser.text("answer"), "the answer of the identification node")
    nodes.wait(lambda: nodes.measured.newest.voltage[-1] > 0.1, "the first move of the identification")
    browser.click("Abort …")
    browser.click("Abort")
    browser.wait(lambda: "aborted" in browser.text("job"), "the end of the identification")


def test_a_change_of_the_stage_appears(nodes, browser):
    publisher = nodes.publisher(DiagnosticStatus, f"{AXIS}/change")
    name = f"{AXIS.strip('/')}/model_node: change"
    values = {"statistic": 5.2, "group": "gain", "change": 0.013, "unit": "1"}
    changed = diagnostic(DiagnosticStatus.WARN, name, "the stage has changed: gain", **values)

    def shown() -> bool:
        publisher.publish(changed)  # the model node goes on saying that there is no baseline
        return "has changed: gain; statistic 5.2, threshold 1; gain: 1.3 %" in browser.text("change")

    browser.wait(shown, "the change")


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGKILL])
def test_the_end_of_a_page_does_not_affect_other_nodes(nodes, browser, ending):
    if not nodes.page.is_running:
        known = nodes.node.get_subscriptions_info_by_topic
        nodes.page = nodes.start("page_node", port=0)
        nodes.wait(lambda: "found the axis" in nodes.page.output, "the page's axis")
        nodes.wait(lambda: "page_node" in {i.node_name for i in known(f"{AXIS}/samples")}, "its subscription")
    before = nodes.measured.lost
    nodes.page.signal(ending)
    nodes.page.wait()
    count = len(nodes.measured.blocks)
    nodes.wait(lambda: len(nodes.measured.blocks) > count + 200, "two seconds more of samples")
    assert nodes.measured.lost == before
    assert all(process.is_running for process in nodes.others)
