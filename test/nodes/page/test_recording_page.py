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

"""`piezo view` in a real browser: a recording, the prediction of a model, and zoom into every sample."""

from __future__ import annotations

import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import write

pytestmark = pytest.mark.nodes  # with the other tests of real processes, one after the other

PERIOD = 2e-5


@pytest.fixture(scope="module")
def viewed(tmp_path_factory, browser):
    """A recording of a model's own output, with a spike of one sample, and its page, open."""
    folder = tmp_path_factory.mktemp("viewed")
    model = Model((BoucWen(), Arx(), Offset()), PERIOD)
    time = PERIOD * np.arange(50_000)
    drive = 4.0 - 4.0 * np.cos(2 * np.pi * 5.0 * time)
    displacement = model.simulate(drive) + 1e-9 * np.random.default_rng(0).normal(size=time.size)
    displacement[12_345] += 2e-7
    write(Experiment((Record(drive, displacement, PERIOD, phase="sine_5hz"),)), folder / "experiment")
    save(model, folder / "model.yaml")
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "view", folder / "experiment", "--no-browser"]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen([*command, "--model", folder / "model.yaml"], stdout=log, stderr=subprocess.STDOUT)
    address = re.compile(r"http://\S+/")
    try:
        found = browser.wait(lambda: address.search((folder / "log").read_text()), "the address of the page")
        browser.open(found.group())
        browser.wait(lambda: len(browser.source("lines").get("residual", [])) > 100, "the residual")
        yield browser, displacement
    finally:
        process.send_signal(signal.SIGINT)
        ended = process.wait(20.0)
    assert ended == 0, (folder / "log").read_text()


def test_the_spike_is_seen_among_all_samples(viewed):
    browser, _ = viewed
    drawn = lines(browser, "residual_time", "residual")
    peak = int(np.argmax(drawn["residual"]))
    assert drawn["residual"][peak] == pytest.approx(200.0, abs=10.0)
    assert drawn["residual_time"][peak] == pytest.approx(12_345 * PERIOD, abs=1e-9)
    assert len(drawn["residual"]) < 2000


def test_zoom_shows_every_sample(viewed):
    browser, displacement = viewed
    first, last = 12_300, 12_400
    browser.value(
        "(() => { const r = Bokeh.documents[0].get_model_by_name('displacement').x_range;"
        f" r.setv({{start: {(first - 0.5) * PERIOD}, end: {(last + 0.5) * PERIOD}}}); }})()"
    )
    drawn = browser.wait(
        lambda: (s := lines(browser, "measured")) and len(s["measured"]) < 500 and s, "the samples of the zoom"
    )
    np.testing.assert_array_equal(drawn["measured"], 1e6 * displacement[first : last + 1])


def lines(browser, *names):
    """Columns of the drawn lines, without their gaps."""
    drawn = {name: np.array(browser.source("lines").get(name, []), float) for name in names}
    return {name: column[np.isfinite(column)] for name, column in drawn.items()}
