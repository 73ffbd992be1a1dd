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

"""Recordings in an S3 server and behind HTTP on this machine."""

from __future__ import annotations

import sys

import pytest

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")

from piezo_hysteresis import recording
from piezo_hysteresis.errors import MissingPackageError, RecordingError
from piezo_hysteresis.fleet.finding import find_recordings
from piezo_hysteresis.fleet.fleet import open_orders, run_fleet
from piezo_hysteresis.fleet.storage import Storage
from piezo_hysteresis.fleet.table.results import Results, read_results
from piezo_hysteresis.fleet.work import Validate

from .conftest import play, store


@pytest.fixture
def bucket(s3_server, client, tmp_path, monkeypatch):
    """A public bucket with three recordings: an experiment of two files, a CSV file and a damaged one."""
    from pyarrow import fs

    keys = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_ENDPOINT_URL": s3_server}
    for name, value in keys.items():
        monkeypatch.setenv(name, value)
    client.run(exec, f"import os; os.environ.update({keys!r})")
    store(["stage_a/2026-11-03", "stage_b/2026-11-04.csv"], tmp_path / "lab")
    (tmp_path / "lab" / "stage_b" / "2026-11-05.npz").write_bytes(b"PK\x03\x04 cut short")
    server = fs.S3FileSystem(endpoint_override=s3_server, allow_bucket_creation=True, region="us-east-1")
    server.create_dir("lab", recursive=False)
    fs.copy_files(str(tmp_path / "lab"), "lab", destination_filesystem=server)
    return server


def work(urls, model_text, client, folder):
    with Results(folder) as results:
        orders = open_orders(find_recordings(urls), Validate(model_text), results)
        return dict(run_fleet(orders, results, client).counts)


def test_s3_and_http(bucket, s3_server, model_text, client, tmp_path):
    results = tmp_path / "results"
    assert work(["s3://lab"], model_text, client, results) == {"done": 2, "failed": 1}
    rows = {row["recording"]: row for row in read_results(results).to_pylist()}
    assert sorted(rows) == [
        "s3://lab/stage_a/2026-11-03", "s3://lab/stage_b/2026-11-04.csv", "s3://lab/stage_b/2026-11-05.npz",
    ]  # fmt: skip
    assert {row["stage"] for row in rows.values()} == {"stage_a", "stage_b"}
    assert rows["s3://lab/stage_b/2026-11-05.npz"]["error"].startswith("s3://lab/stage_b/2026-11-05.npz")
    assert work(["s3://lab/stage_*/*"], model_text, client, results) == {}

    recording.write(play(9), tmp_path / "new.csv")
    with bucket.open_output_stream("lab/stage_b/2026-11-04.csv") as file:
        file.write((tmp_path / "new.csv").read_bytes())
    assert work(["s3://lab/stage_b/2026-11-04.csv"], model_text, client, results) == {"done": 1}
    assert len(read_results(results)) == 3

    web = f"{s3_server}/lab/stage_b/2026-11-04.csv"
    assert work([web], model_text, client, tmp_path / "web") == {"done": 1}
    (row,) = read_results(tmp_path / "web").to_pylist()
    (same,) = [r for r in read_results(results).to_pylist() if r["recording"].endswith(".csv")]
    assert row["data_hash"] == same["data_hash"]
    assert row["free_run_error_m"] == same["free_run_error_m"]


def test_a_recording_that_vanishes_is_tried_again_by_the_next_run(bucket, model_text, client, tmp_path):
    (source,) = find_recordings(["s3://lab/stage_b/2026-11-04.csv"])
    content = bucket.open_input_stream("lab/stage_b/2026-11-04.csv").read()
    bucket.delete_file("lab/stage_b/2026-11-04.csv")
    with Results(tmp_path / "results") as results:
        orders = open_orders([source], Validate(model_text), results)
        assert run_fleet(orders, results, client).counts == {"unreachable": 1}
        with bucket.open_output_stream("lab/stage_b/2026-11-04.csv") as file:
            file.write(content)
        orders = open_orders([source], Validate(model_text), results)
        assert run_fleet(orders, results, client).counts == {"done": 1}


def test_an_unknown_bucket_is_refused(bucket):
    with pytest.raises(RecordingError, match="s3://nobody"):
        find_recordings(["s3://nobody/x"], Storage())


def test_without_the_extra_one_line_states_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec", None)
    from piezo_hysteresis.fleet.storage import _disk

    _disk.cache_clear()
    with pytest.raises(MissingPackageError, match=r"pip install 'piezo_hysteresis\[fleet\]'"):
        find_recordings([str(tmp_path)])
