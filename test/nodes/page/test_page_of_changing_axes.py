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

"""The live page of axes whose nodes end, begin again and change: it chooses, follows, reports and recalibrates."""

from __future__ import annotations

import re
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.changes.recalibration_history import FILE, read_numbers
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud
from piezo_hysteresis.nodes.page.page_node import PageNode

pytestmark = pytest.mark.nodes

ROOT = Path(__file__).parents[3]
PERIOD = 1e-4
AXIS, OTHER = "/stage_x", "/stage_y"
SCALE = "simulated__structure__displacement_scale"


@pytest.fixture(scope="module")
def nodes(shared_lab, browser):
    """Two axes, the first with a model node, and their page."""
    lab = shared_lab
    lab.first = lab.driver(namespace=AXIS, sample_period=PERIOD)
    lab.kept = lab.folder / "kept"
    model = {"model_file": str(ROOT / "config" / "published_stage.yaml"), "baseline_time": 20.0}
    lab.start("model_node", namespace=AXIS, baseline_folder=str(lab.kept), **model)
    lab.driver(namespace=OTHER, sample_period=PERIOD)
    page = lab.page = lab.start("page_node", port=0)
    url = lab.wait(lambda: re.search(r"http://127\.0\.0\.1:(\d+)/", page.output), "the address of the page")
    lab.port = int(url.group(1))
    lab.wait(lambda: page.output.count("found the axis") == 2, "both axes")
    predicted = lab.listen(PointCloud2, f"{AXIS}/predicted_samples")
    lab.wait(lambda: predicted, "a prediction")
    browser.open(url.group())
    browser.wait(lambda: "idle" in browser.text("phase"), "the phase")
    return lab


def test_a_call_before_an_axis_was_found_is_answered():
    """The page went on to say that it was sent."""
    answer = PageNode.call(SimpleNamespace(_feeds={}), "", "driver_node/stop").result(timeout=1.0)
    assert not answer.success
    assert answer.message == "no axis '' was found yet; nothing was sent"


def scan(lab, axis, seconds):
    """Drive an axis for a while; 10 Hz, 0 to 8 V."""
    at = PERIOD * np.arange(round(seconds / PERIOD))
    publisher = lab.publisher(PointCloud2, f"{axis}/command")
    publisher.publish(command_to_cloud(4.0 * (1.0 - np.cos(2 * np.pi * 10.0 * at)), PERIOD, "scan"))


def choose(browser, axis):
    """Choose an axis in the list, as a visitor does."""
    browser.value(f"Bokeh.documents[0].get_model_by_name('axis').setv({{value: '{axis}'}})")


def newest_voltage(browser):
    return float((browser.text("voltage") or "nan V").split()[0])


def test_every_axis_can_be_chosen_and_its_buttons_act_on_it_alone(nodes, browser):
    scan(nodes, OTHER, 60.0)
    choose(browser, OTHER)
    browser.wait(lambda: "scan" in browser.text("phase"), "the scan of the other axis")
    browser.wait(lambda: max(browser.loop()["voltage"], default=0.0) > 7.5, "its loop")
    choose(browser, AXIS)
    browser.wait(lambda: "idle" in browser.text("phase"), "the axis that rests")
    browser.wait(lambda: newest_voltage(browser) == 0.0, "its voltage")
    choose(browser, OTHER)
    browser.click("Stop")
    browser.wait(lambda: "stopped" in browser.text("driver"), "the stop of the other axis")
    choose(browser, AXIS)
    browser.wait(lambda: "stopped" not in browser.text("driver"), "the first axis, which is not stopped")


def test_a_driver_that_starts_again_as_another_stage_raises_an_alarm_and_is_recalibrated(nodes, browser):
    choose(browser, AXIS)
    scan(nodes, AXIS, 110.0)
    browser.wait(lambda: "scan" in browser.text("phase"), "the scan")
    browser.click("Take baseline …")
    browser.click("Take baseline")
    browser.wait(lambda: "no change since" in browser.text("change"), "a baseline")

    nodes.first.signal(signal.SIGKILL)
    nodes.first.wait()
    browser.wait(lambda: "no driver" in browser.text("driver"), "the end of the driver")
    nodes.driver(namespace=AXIS, sample_period=PERIOD, **{SCALE: 1.01e-4})
    browser.wait(lambda: "idle" in browser.text("phase"), "the new driver, found again")
    sent = float("-inf")

    def is_scanning():
        """A command may go to the killed driver alone, which DDS takes for alive for some seconds."""
        nonlocal sent
        if "scan" in browser.text("phase"):
            return True
        if time.monotonic() - sent > 10.0:
            sent = time.monotonic()
            scan(nodes, AXIS, 110.0)
        return False

    browser.wait(is_scanning, "its scan")
    browser.wait(lambda: "has changed: gain" in browser.text("change"), "the alarm of the watch")
    browser.wait(lambda: "has changed" in browser.text("alarms"), "the alarm in the list")

    nodes.pause(5.0)
    browser.click("Recalibrate …")
    browser.wait(lambda: "gain has changed" in browser.text("question"), "the plan")
    browser.click("Recalibrate")
    browser.wait(lambda: "displacement_scale" in browser.text("recalibrations"), "the history")
    browser.wait(lambda: "no change since" in browser.text("change"), "a silent watch")
    (number,) = read_numbers((nodes.kept / FILE).read_text(), "file")
    assert number.new / number.old == pytest.approx(1.01, abs=0.002)
    assert f"{number.new:.6g}" in browser.text("recalibrations")
    drawn = browser.source("history")
    assert [drawn[c] for c in ("value", "low", "high")] == [[number.new], [number.low], [number.high]]


def test_a_page_without_its_program_says_so_and_is_loaded_anew_with_the_same_axis(nodes, browser):
    """It went on to show the last numbers under a green badge, and its Stop did nothing, also after the restart."""
    choose(browser, OTHER)
    browser.wait(lambda: OTHER.strip("/") in browser.value("location.search"), "the axis in the address")
    nodes.page.signal(signal.SIGKILL)
    nodes.page.wait()
    browser.wait(lambda: browser.value("document.getElementById('lost').offsetHeight") > 0, "the notice")
    assert not browser.value("document.body.classList.contains('live')")
    nodes.start("page_node", port=nodes.port)
    browser.wait(lambda: browser.value("document.body?.className") == "live", "the page, loaded anew")
    browser.wait(lambda: browser.value("Bokeh.documents[0].get_model_by_name('axis').value") == OTHER, "the axis")
    browser.click("Stop")
    browser.wait(lambda: f"Stop {OTHER}" in browser.text("answer"), "the answer of the driver")


def test_a_stop_that_is_pressed_while_the_page_node_hangs_is_carried_out_when_it_goes_on(nodes, browser):
    choose(browser, AXIS)
    browser.wait(lambda: "stopped" not in browser.text("driver"), "the first axis, which is not stopped")
    page = nodes.processes[-1]
    page.signal(signal.SIGSTOP)
    browser.wait(lambda: browser.value("document.getElementById('lost').offsetHeight") > 0, "the notice")
    browser.click("Stop")
    page.signal(signal.SIGCONT)
    browser.wait(lambda: "stopped" in browser.text("driver"), "the stop")
