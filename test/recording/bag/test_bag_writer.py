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

"""The recorder: what it wrote is there even when it is killed or the disk is full."""

import os
import resource
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from unittest.mock import patch

import pytest
import yaml
from rosbags.rosbag2 import Reader

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import Bag, BagWriter
from piezo_hysteresis.recording.bag.bag import REORDERING_HORIZON
from piezo_hysteresis.recording.bag.mcap_file import MAGIC, McapFile
from piezo_hysteresis.recording.bag.phase_topic import STRING, PhaseNames

ROOT = Path(__file__).parents[3]


def test_metadata_give_topics_counts_times_and_quality_of_service(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/stage_x/phase", STRING, depth=1, transient_local=True).add_topic(
            "/best", STRING, reliable=False
        )
        for time_ns in (5, 3, 9):
            bag.write("/stage_x/phase", time_ns, PhaseNames.to_cdr(1, "step"))
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["message_count"] == 3
    assert information["starting_time"]["nanoseconds_since_epoch"] == 3
    assert information["duration"]["nanoseconds"] == 6
    with Reader(tmp_path / "bag") as reader:
        first, second = sorted(reader.connections, key=lambda c: c.topic, reverse=True)
        assert (first.topic, first.msgtype, first.msgcount) == ("/stage_x/phase", STRING, 3)
        (qos,) = first.ext.offered_qos_profiles
        assert (qos.depth, qos.durability.name, qos.reliability.name) == (1, "TRANSIENT_LOCAL", "RELIABLE")
        assert second.ext.offered_qos_profiles[0].reliability.name == "BEST_EFFORT"
        assert first.digest.startswith("RIHS01_")


def test_metadata_are_valid_from_the_first_moment(tmp_path):
    bag = BagWriter(tmp_path / "bag")
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["storage_identifier"] == "mcap"
    assert list(Bag(tmp_path / "bag").messages()) == []
    bag.close()
    bag.close()


def test_a_growing_file_is_read_up_to_its_length_at_the_start(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/phase", STRING)
        for time_ns in range(3):
            bag.write("/phase", time_ns, PhaseNames.to_cdr(time_ns, "step"))
    whole = next((tmp_path / "bag").glob("*.mcap")).read_bytes()
    growing = tmp_path / "growing.mcap"
    counts = set()
    for cut in range(len(MAGIC), len(whole)):
        growing.write_bytes(whole[:cut])
        file = McapFile(growing)
        size = growing.stat().st_size
        growing.write_bytes(whole)
        with patch.object(Path, "stat", lambda self, size=size: os.stat_result((0,) * 6 + (size,) + (0,) * 3)):
            counts.add(len(list(file.messages())))
    assert counts == {0, 1, 2, 3}


def test_a_bag_is_never_overwritten_and_never_guessed(tmp_path):
    bag = BagWriter(tmp_path / "bag")
    with pytest.raises(RecordingError, match="exists"):
        BagWriter(tmp_path / "bag")
    with pytest.raises(RecordingError, match="was not added"):
        bag.write("/phase", 0, b"")
    with pytest.raises(RecordingError, match="message type"):
        bag.add_topic("/x", "foreign_msgs/msg/Thing")
    bag.add_topic("/x", STRING)
    with pytest.raises(RecordingError, match="expected std_msgs"):
        bag.add_topic("/x", "std_msgs/msg/Float64")
    bag.close()
    with pytest.raises(RecordingError, match="ended"):
        bag.write("/x", 0, PhaseNames.to_cdr(0, "idle"))


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="Not a directory"):
        BagWriter(tmp_path / "file" / "bag")


def _written_by(tmp_path, body, expect):
    script = f"""
        import sys
        from piezo_hysteresis.recording import BagWriter
        from piezo_hysteresis.recording.bag.phase_topic import STRING, PhaseNames
        from piezo_hysteresis.errors import RecordingError
        bag = BagWriter({str(tmp_path / "bag")!r})
        bag.add_topic("/phase", STRING)
        message = PhaseNames.to_cdr(1, "x" * 1000)
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script) + textwrap.dedent(body)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=expect.pop("limit", None),
    )
    return process


def test_a_killed_recorder_loses_only_messages_after_the_last_flush(tmp_path):
    body = """
        for k in range(3000):
            bag.write("/phase", k, message)
        bag.flush()
        for k in range(3000, 3010):
            bag.write("/phase", k, message)
        print("written", flush=True)
        sys.stdin.read()
    """
    process = _written_by(tmp_path, body, {})
    assert process.stdout.readline() == "written\n"
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    bag = Bag(tmp_path / "bag")
    times = [message.time_ns for message in bag.messages()]
    assert times[:3000] == list(range(3000))
    assert [n.kind for n in bag.notices] == ["cut"]


def test_a_full_disk_ends_the_recording_with_one_line_and_keeps_what_is_written(tmp_path):
    """A limit on the file's size stands for the disk: the write fails in the same call, with an OSError."""
    body = """
        import signal
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        try:
            for k in range(100_000):
                bag.write("/phase", k, message)
        except RecordingError as error:
            print(error, flush=True)
        try:
            bag.write("/phase", 0, message)
        except RecordingError as error:
            print(error, flush=True)
        bag.close()
    """
    limit = 3 << 20
    process = _written_by(tmp_path, body, {"limit": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))})
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    first, second = out.splitlines()
    assert "File too large" in first
    assert "ended" in second
    times = [message.time_ns for message in Bag(tmp_path / "bag").messages()]
    assert times == list(range(len(times)))
    assert len(times) * 1000 > limit - 600_000


def test_messages_come_in_time_order_for_a_player(tmp_path):
    order = [5, 1, 4, 2, 3, 9, 7, 8, 6]
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", STRING).add_topic("/b", STRING)
        for k in order:
            bag.write("/a" if k % 2 else "/b", k * REORDERING_HORIZON // 10, PhaseNames.to_cdr(k, "x"))
    bag = Bag(tmp_path / "bag")
    assert [m.time_ns for m in bag.in_time_order()] == [k * REORDERING_HORIZON // 10 for k in range(1, 10)]
    assert {m.topic for m in bag.in_time_order({"/b"})} == {"/b"}


def test_a_recording_split_into_several_files_is_one(tmp_path):
    for k in (0, 1, 10):
        with BagWriter(tmp_path / f"part_{k}") as bag:
            bag.add_topic("/a", STRING)
            bag.write("/a", k, PhaseNames.to_cdr(k, "x"))
    whole = tmp_path / "whole"
    whole.mkdir()
    for k in (0, 1, 10):
        next((tmp_path / f"part_{k}").glob("*.mcap")).rename(whole / f"run_{k}.mcap")
    assert [m.time_ns for m in Bag(whole).messages()] == [0, 1, 10]
