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
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

pytest.importorskip("fsspec")

from piezo_hysteresis import recording
from piezo_hysteresis.errors import ParameterError, RecordingError
from piezo_hysteresis.fleet.fetching import fetch
from piezo_hysteresis.fleet.finding import find_recordings
from piezo_hysteresis.fleet.source import NamePattern
from piezo_hysteresis.record import Experiment, Record


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


@pytest.mark.parametrize("ending", ["asc", "lvm", "tdms"])
def test_what_instruments_write_is_found_in_a_folder(tmp_path, ending):
    """Tables of LabVIEW were read if they were named, and passed over in a folder."""
    (tmp_path / f"run.{ending}").write_text("0 0\n")
    assert [s.url for s in find_recordings([str(tmp_path)])] == [f"{tmp_path}/run.{ending}"]


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


def found_in(folder, *urls):
    """The places of the recordings in a folder, and the numbers of their files."""
    return {os.path.relpath(s.url, folder): len(s.files) for s in find_recordings(urls or [str(folder)])}


def test_a_folder_in_a_bag_leaves_the_bag_whole(tmp_path):
    for name in ("bag_0.mcap", "bag_1.mcap", "figures/look.csv", "metadata.yaml"):
        (tmp_path / "bag" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "bag" / name).write_text(name)
    assert found_in(tmp_path) == {"bag": 3, "bag/figures/look.csv": 1}


def test_tables_beside_metadata_that_are_not_of_a_bag_are_recordings(tmp_path):
    for name in ("a.csv", "b.csv", "metadata.yaml"):
        (tmp_path / name).write_text(name)
    assert found_in(tmp_path) == {"a.csv": 1, "b.csv": 1}


def test_every_phase_of_an_experiment_belongs_to_it(tmp_path):
    rest = Record(np.zeros(9), np.zeros(9), 1e-3)
    phases = ("rest", "sine_0.5hz", "sine-2", "100", "step+rest")
    recording.write(Experiment(tuple(replace(rest, phase=phase) for phase in phases)), tmp_path / "run")
    assert found_in(tmp_path) == {"run": len(phases)}


def test_links_are_followed_and_every_folder_is_read_once(lab, tmp_path_factory):
    inbox = tmp_path_factory.mktemp("inbox")
    os.utime(lab / "stage_b/20261104T1530.csv", (1.7e9, 1.7e9))
    (inbox / "stage_b").symlink_to(lab / "stage_b")
    (inbox / "again").symlink_to(inbox)
    (inbox / "run.csv").symlink_to(lab / "stage_b/20261104T1530.csv")
    (inbox / "missing.csv").symlink_to("nowhere.csv")
    os.mkfifo(inbox / "pipe.csv")
    stage_b = {"stage_b/2026-10-05.NPZ": 1, "stage_b/20261104T1530.csv": 1}
    assert found_in(inbox) == {"missing.csv": 1, "run.csv": 1} | stage_b
    assert found_in(inbox, f"{inbox}/stage_*", f"{inbox}/../{inbox.name}/stage_b") == stage_b
    (run,) = find_recordings([f"{inbox}/run.csv"])
    assert run in find_recordings([str(inbox)])
    assert run.recorded_at == datetime.fromtimestamp(1.7e9, UTC)


def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (pipe,) = find_recordings([f"{tmp_path}/pipe.csv"])
    with pytest.raises(RecordingError, match="is no regular file"), ExitStack() as stack:
        fetch(pipe, stack)


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
