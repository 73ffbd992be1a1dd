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

"""A disk that becomes full leaves the page and the answer of before, and no half of a new one."""

import resource
from contextlib import contextmanager

import pytest
from matplotlib.figure import Figure

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.report.figures.drawing import Drawing
from piezo_hysteresis.report.json_file import read_json, write_json
from piezo_hysteresis.report.page import Page


@contextmanager
def disk_of(size):
    """The system refuses to let a file grow beyond `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_page_of_before_is_kept(tmp_path):
    path = tmp_path / "report.html"
    Page("<p>before</p>", ()).save(path)
    with disk_of(10_000), pytest.raises(RecordingError, match="File too large"):
        Page("<p>after</p>" * 10_000, ()).save(path)
    assert path.read_text() == "<p>before</p>"
    assert [p.name for p in tmp_path.iterdir() if p.is_file()] == ["report.html"]


def test_an_answer_of_before_is_kept(tmp_path):
    path = tmp_path / "answer.json"
    write_json(str(path), {"verdict": "named"})
    with disk_of(10_000), pytest.raises(RecordingError, match="File too large"):
        write_json(str(path), {"verdict": "unknown" * 10_000})
    assert read_json(str(path)) == {"verdict": "named"}
    assert [p.name for p in tmp_path.iterdir()] == ["answer.json"]


def test_a_figure_that_cannot_be_written_is_named(tmp_path):
    drawing = Drawing("gap", "", "", "", Figure(), {})
    with disk_of(100), pytest.raises(RecordingError, match="figures/gap: File too large"):
        drawing.save(tmp_path / "figures")
