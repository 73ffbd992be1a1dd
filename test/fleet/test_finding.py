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

"""Which files are recordings, of which stage, and when they were taken."""

from __future__ import annotations

import os
from datetime import UTC, datetime

import pytest

pytest.importorskip("fsspec")

from piezo_hysteresis.errors import ParameterError, RecordingError
from piezo_hysteresis.fleet.finding import find_recordings
from piezo_hysteresis.fleet.source import NamePattern


@pytest.fixture
def lab(tmp_path):
    """A bag, an experiment of NPZ files, single files, and what is no recording."""
    for name in (
        "stage_a/2026-11-03/01_rest.npz", "stage_a/2026-11-03/02_triangle.npz", "stage_a/bag/metadata.yaml",
        "stage_a/bag/bag_0.mcap", "stage_b/20261104T1530.csv", "stage_b/2026-10-05.NPZ", "stage_b/notes.md",
    ):  # fmt: skip
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    os.utime(tmp_path / "stage_a/bag/bag_0.mcap", (1.8e9, 1.8e9))
    return tmp_path


def test_a_folder_gives_every_recording_in_it_once(lab):
    found = {s.url.removeprefix(f"{lab}/"): s for s in find_recordings([str(lab), f"{lab}/stage_b"])}
    assert list(found) == ["stage_a/2026-11-03", "stage_a/bag", "stage_b/2026-10-05.NPZ", "stage_b/20261104T1530.csv"]
    assert [len(s.files) for s in found.values()] == [2, 2, 1, 1]
    assert [s.stage for s in found.values()] == ["stage_a", "stage_a", "stage_b", "stage_b"]
    assert [s.month for s in found.values()] == ["2026-11", "2027-01", "2026-10", "2026-11"]
    assert found["stage_b/20261104T1530.csv"].recorded_at == datetime(2026, 11, 4, 15, 30, tzinfo=UTC)
    assert len({s.version for s in found.values()}) == 4


def test_patterns(lab):
    assert [s.url for s in find_recordings([f"{lab}/stage_?/2026*"])] == [
        f"{lab}/stage_a/2026-11-03", f"{lab}/stage_b/2026-10-05.NPZ", f"{lab}/stage_b/20261104T1530.csv",
    ]  # fmt: skip
    names = NamePattern(r"(?P<stage>b)/(?P<date>[^.]+)")
    (named,) = find_recordings([f"{lab}/**/*.csv"], names=names)
    assert (named.stage, named.month) == ("b", "2026-11")


def test_a_file_whose_name_looks_like_a_pattern_is_found(lab):
    (lab / "run[1].csv").write_text("rows")
    assert [s.url for s in find_recordings([f"{lab}/run[1].csv"])] == [f"{lab}/run[1].csv"]


def test_the_version_changes_with_the_file(lab):
    place = lab / "stage_a" / "2026-11-03"
    (before,) = find_recordings([str(place)])
    (place / "02_triangle.npz").write_text("longer than it was before")
    (after,) = find_recordings([str(place)])
    assert before.version != after.version


@pytest.mark.parametrize("url", ["missing", "stage_b/*.h5", "stage_b/notes"])
def test_a_url_without_recordings_is_refused(lab, url):
    with pytest.raises(RecordingError, match="expected"):
        find_recordings([f"{lab}/{url}"])


def test_an_unknown_url_scheme_is_refused():
    with pytest.raises(RecordingError, match="expected a local path, s3://"):
        find_recordings(["nowhere://lab/x.npz"])


@pytest.mark.parametrize("text", ["(", "(?P<name>x)"])
def test_a_pattern_without_a_group_is_refused(text):
    with pytest.raises(ParameterError, match="expected a"):
        NamePattern(text)
