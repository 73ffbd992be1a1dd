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

"""The figures of the page: what they show at one moment belongs together."""

from __future__ import annotations

import numpy as np
from bokeh.document import Document
from bokeh.document.events import ColumnDataChangedEvent

from piezo_hysteresis.report.live.figures import LINES, WindowFigures
from piezo_hysteresis.report.live.sample_window import Window


def test_measured_predicted_and_residual_reach_the_browser_in_one_message():
    figures, document = WindowFigures(), Document()
    for drawn in figures.all:
        document.add_root(drawn)
    figures.span(0.0, 1.0)
    changes = []
    document.on_change(changes.append)
    time = np.linspace(0.0, 1.0, 5000)
    measured = np.where(time > 0.9, np.nan, 1e-6 * np.sin(40.0 * time))
    figures.draw(Window(time, 5.0 * time, measured, 0.9 * measured, time[1]), 0.0, None, None)
    shown = [c.model.data for c in changes if isinstance(c, ColumnDataChangedEvent)]
    (only,) = [data for data in shown if set(LINES) & set(data)]
    assert set(only) == set(LINES)
    size = {name: np.isfinite(only[name]).sum() for name in LINES}
    assert min(size.values()) > 300
    for name, factor in (("measured", 1.0), ("predicted", 0.9)):
        real = np.isfinite(only[name])
        expected = factor * np.sin(40.0 * only[f"{name}_time"][real])
        np.testing.assert_allclose(only[name][real], expected, atol=1e-9)
