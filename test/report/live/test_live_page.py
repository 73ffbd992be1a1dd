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

"""The live page without a browser: what is drawn of an axis, whatever part of the time axis is shown."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bokeh.document import Document

from piezo_hysteresis.report.live.axis_state import AxisState
from piezo_hysteresis.report.live.live_page import LivePage

PERIOD, NOISE = 1e-4, 2e-9


@pytest.fixture
def page():
    """A page of an axis whose newest samples lie at 5 V."""
    axis, index = AxisState("/stage_x"), np.arange(20_000, dtype=np.uint32)
    measured = 1e-5 + np.random.default_rng(1).normal(scale=NOISE, size=index.size)
    axis.window.add(index, PERIOD * index, np.full(index.size, 5.0), measured)
    return LivePage(Document(), SimpleNamespace(axes=lambda: {"/stage_x": axis}))


def drawn(page, start, end):
    page._figures._time.update(start=start, end=end)
    page._slow = float("-inf")
    page._tick()
    return page._figures._lines.data["voltage"]


@pytest.mark.parametrize(("start", "end"), [(1.0, 4.0), (-1e6, -1e5), (float("nan"), 0.0)])
def test_no_old_line_remains_where_no_sample_is_shown(page, start, end):
    assert drawn(page, -1.0, 0.0).size
    assert not drawn(page, start, end).size


def test_the_noise_does_not_depend_on_the_zoom(page):
    drawn(page, -0.006, 0.0)
    assert page._noise == pytest.approx(NOISE, rel=0.05)
