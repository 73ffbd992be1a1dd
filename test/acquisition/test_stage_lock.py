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

"""One driver per stage; a lock ends with its process."""

import os
import subprocess
import sys
import time

import pytest

from piezo_hysteresis.acquisition import stage_lock
from piezo_hysteresis.acquisition.stage_lock import StageLock
from piezo_hysteresis.errors import StageError

HOLDER = """
import sys
from pathlib import Path
from piezo_hysteresis.acquisition import stage_lock
from piezo_hysteresis.acquisition.stage_lock import StageLock
stage_lock.FOLDERS = (Path(sys.argv[1]),)
lock = StageLock(["device A"])
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    tmp_path.chmod(0o777)
    monkeypatch.setattr(stage_lock, "FOLDERS", (tmp_path,))


def test_the_second_is_refused_until_the_first_releases():
    first = StageLock(["device A", "namespace /x"])
    with pytest.raises(StageError, match="namespace /x is held by process"):
        StageLock(["device B", "namespace /x"])
    StageLock(["device B"]).release()
    first.release()
    first.release()
    StageLock(["device A", "namespace /x"]).release()


def test_a_killed_process_releases_its_lock(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with holder:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(StageError, match=f"process {holder.pid}"):
            StageLock(["device A"])
        holder.kill()
        holder.wait()
        StageLock(["device A"]).release()


def test_a_process_that_inherits_a_lock_holds_it_until_it_ends(tmp_path):
    """The keeper of a driver that was killed still moves the stage."""
    inherits = HOLDER.replace(
        "sys.stdin.read()",
        "import subprocess\nsubprocess.Popen(['sleep', '1.5'], pass_fds=lock.descriptors)\nsys.stdin.read()",
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", inherits, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with holder:
        assert holder.stdout.readline() == b"held\n"
        time.sleep(0.2)
        holder.kill()
        time.sleep(0.2)
        begin = time.monotonic()
        StageLock(["device A"]).release()  # also before somebody has asked how the process ended
        assert time.monotonic() - begin > 0.3, "it waits for the process that is left"


def test_a_lock_that_was_released_is_waited_for_where_a_keeper_still_holds_it():
    first = StageLock(["device A"])
    keeper = subprocess.Popen(["sleep", "1.0"], pass_fds=first.descriptors)
    with pytest.raises(StageError, match="is held by process"):
        StageLock(["device A"])
    first.release()
    begin = time.monotonic()
    StageLock(["device A"]).release()
    assert time.monotonic() - begin > 0.3
    keeper.wait()


def test_a_damaged_lock_is_refused_in_one_line(tmp_path):
    first = StageLock(["device A"])
    (path,) = tmp_path.glob("*.lock")
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(StageError, match="device A is held by process"):
        StageLock(["device A"])
    first.release()


def test_the_folder_does_not_depend_on_the_environment(tmp_path, monkeypatch):
    monkeypatch.undo()
    device = f"device {tmp_path}"
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    first = StageLock([device])
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with pytest.raises(StageError, match="is held by process"):
        StageLock([device])
    first.release()


def test_a_folder_in_which_not_everybody_may_write_is_passed_over(tmp_path, monkeypatch):
    narrow, wide = tmp_path / "narrow", tmp_path / "wide"
    for folder, mode in ((narrow, 0o755), (wide, 0o1777)):
        folder.mkdir()
        folder.chmod(mode)
    monkeypatch.setattr(stage_lock, "FOLDERS", (tmp_path / "missing", narrow, wide))
    mask = os.umask(0o077)
    try:
        StageLock(["device A"]).release()
    finally:
        os.umask(mask)
    assert not list(narrow.iterdir())
    assert [file.stat().st_mode & 0o777 for file in wide.iterdir()] == [0o666]
