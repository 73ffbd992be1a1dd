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

"""A process whose terminal takes no text goes on, and what it wrote is complete where the terminal takes it."""

import os
import pty
import re
import signal
import subprocess
import sys
import threading

import pytest

from piezo_hysteresis.acquisition.safety.console import LONGEST_BACKLOG, Console

from ..paused_pipe import paused_pipe

PATIENCE = 60.0
IMPORTS = """
import os, signal, subprocess, sys, time
from piezo_hysteresis.acquisition.safety.console import Console
"""
MIXED = """
with Console():
    for number in range(0, 30_000, 3):
        print(number)
        sys.stdout.flush()
        sys.stderr.write(f"{number + 1}\\n")
        os.write(2, f"{number + 2}\\n".encode())
    print("no end of line", end="")
    %s
"""


def ended(program, *, environment=None, **streams):
    """A process that has run a program."""
    command = [sys.executable, "-c", IMPORTS + program]
    full = os.environ | (environment or {})
    return subprocess.run(command, timeout=PATIENCE, check=False, env=full, **streams)


@pytest.mark.parametrize(
    ("last", "status", "text"),
    [
        ("pass", 0, "no end of line"),
        ("sys.exit('reason')", 1, "no end of linereason\n"),
        ("sys.exit(2)", 2, "no end of line"),
        ("raise ValueError('reason')", 1, "no end of lineTraceback .*\nValueError: reason\n"),
    ],
)
def test_nothing_is_lost_and_the_order_is_kept_where_the_text_is_read(last, status, text):
    done = ended(MIXED % last, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    lines = done.stdout.decode().split("\n", 30_000)
    numbers, rest = lines[:30_000], lines[30_000]
    assert done.returncode == status
    assert numbers == [str(number) for number in range(30_000)]
    assert re.fullmatch(text, rest, re.DOTALL)


def test_two_descriptors_that_lead_to_two_places_stay_apart():
    done = ended("with Console():\n print('out')\n sys.stderr.write('err\\n')", capture_output=True)
    assert (done.stdout, done.stderr) == (b"out\n", b"err\n")


def test_one_long_text_is_complete():
    text = "x" * 700_000
    done = ended(f"with Console(): print('x' * {len(text)})", capture_output=True, text=True)
    assert done.stdout == f"{text}\n"


@pytest.mark.parametrize(
    "write", ["print('x' * 99)", "sys.stderr.write('y' * 99)", "ctypes.PyDLL(None).write(2, b'z' * 99, 99)"]
)
def test_a_process_whose_reader_stands_still_ends(write):
    """The last one, as rclpy does, holds the lock of the interpreter while it writes."""
    with paused_pipe() as (_, full):
        program = f"import ctypes\nwith Console():\n for _ in range(20_000): {write}"
        done = ended(program, stdout=full, stderr=full)
    assert done.returncode == 0


def test_lost_lines_are_announced_where_they_are_missing():
    sent = 3 * LONGEST_BACKLOG // 100
    program = f"""
with Console():
    for number in range({sent}):
        sys.stderr.write(f"{{number:099d}}\\n")
    print("sent", flush=True)
    sys.stdin.readline()
    sys.stderr.write("read again\\n")
"""
    with paused_pipe(is_full=False) as (read, write):
        command = [sys.executable, "-c", IMPORTS + program]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=write)
        os.close(write)
        assert process.stdout.readline() == b"sent\n"
        with open(read, "rb", closefd=False) as terminal:
            lines = []
            while not lines or b"lost" not in lines[-1]:
                lines.append(terminal.readline())
            process.communicate(b"\n", timeout=PATIENCE)
            last = terminal.read()
    kept = [int(line) for line in lines[:-1]]
    assert kept == list(range(len(kept)))
    assert lines[-1].startswith(f"{sent - len(kept)} lines lost: ".encode())
    assert last == b"read again\n"
    assert process.returncode == 0


def test_a_reader_that_ends_ends_nothing():
    with paused_pipe(is_full=False) as (read, write):
        os.close(read)
        program = "with Console():\n for _ in range(1000): print('x', flush=True)\nos._exit(3)"
        assert ended(program, stdout=write, stderr=write).returncode == 3


def test_a_process_that_outlives_this_one_still_reaches_the_terminal():
    child = "import time; time.sleep(1.0); import os; os.write(2, b'child\\n')"
    program = f"""
with Console():
    subprocess.Popen([sys.executable, "-c", {child!r}], stderr=sys.stderr.fileno(), stdout=subprocess.DEVNULL)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    done = ended(program, capture_output=True)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, b"child\n")


def test_the_last_words_of_a_process_that_crashes_reach_the_terminal():
    program = "import faulthandler\nfaulthandler.enable()\nwith Console(): faulthandler._sigabrt()"
    assert b"Fatal Python error: Aborted" in ended(program, capture_output=True).stderr


@pytest.mark.parametrize(("given", "colours"), [({}, "1"), ({"RCUTILS_COLORIZED_OUTPUT": "0"}, "0")])
def test_a_terminal_keeps_its_colours_and_the_streams_their_properties(given, colours):
    program = """
with Console():
    print(os.environ["RCUTILS_COLORIZED_OUTPUT"], sys.stdout.isatty(), sys.stderr.isatty(), os.isatty(2))
    print(*((s.encoding, s.errors, s.line_buffering, s.write_through) for s in (sys.stdout, sys.__stdout__)), sep=";")
print(os.isatty(2), sys.stdout is sys.__stdout__, sys.stderr is sys.__stderr__)
"""
    master, slave = pty.openpty()
    environment = {"PYTHONIOENCODING": "latin-1:replace"} | given
    assert ended(program, environment=environment, stdout=slave, stderr=slave).returncode == 0
    os.close(slave)
    with os.fdopen(master, "rb") as terminal:
        lines = [terminal.readline().strip().decode() for _ in range(3)]
    assert lines[0] == f"{colours} True True False"
    ours, original = lines[1].split(";")
    assert ours == original
    assert ours.startswith("('iso8859-1', 'replace', ")
    assert lines[2] == "True True True"


def test_a_file_is_left_alone(tmp_path):
    program = "with Console(): os.write(2, b'last words\\n'); os.kill(os.getpid(), signal.SIGKILL)"
    with (tmp_path / "log").open("wb") as log:
        ended(program, stdout=log, stderr=log)
    assert (tmp_path / "log").read_bytes() == b"last words\n"


def test_closed_descriptors_are_left_alone():
    command = f"exec '{sys.executable}' -c '{IMPORTS}\nwith Console(): os._exit(3)' >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], timeout=PATIENCE, check=False).returncode == 3


def test_the_descriptors_and_threads_of_a_test_are_those_of_before(capfd):
    def state():
        return [os.fstat(number).st_ino for number in (1, 2)], sys.stdout, sys.stderr, threading.active_count()

    before = state()
    with paused_pipe(is_full=False) as (read, write):
        own = os.dup(2)
        os.dup2(write, 2)
        with Console():
            os.write(2, b"text\n")
        assert os.path.sameopenfile(2, write)
        os.dup2(own, 2)
        os.close(own)
        assert os.read(read, 100) == b"text\n"
    assert state() == before
    assert capfd.readouterr() == ("", "")
