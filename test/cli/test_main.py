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

"""The command as such: starts fast, one line per error, exit status, never a traceback."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.cli.main import BROKEN_PIPE, COMMANDS, INTERRUPTED
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

NAMES = [name for commands in COMMANDS.values() for name in commands]


def test_help_names_every_command_and_loads_nothing_heavy():
    code = (
        "import sys; from piezo_hysteresis.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'scipy', 'numba', 'matplotlib', 'rich'} & set(sys.modules)\n"
        "sys.exit(f'loaded {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in NAMES)


@pytest.mark.parametrize("command", NAMES)
def test_every_command_explains_itself(piezo, command):
    done = piezo(command, "--help")
    assert done.status == 0
    assert done.out.startswith(f"usage: piezo {command}")


@pytest.mark.parametrize("words", ["", "nosuch", "identify", "identify e --nosuch", "simulate --seed -1"])
def test_wrong_arguments_are_reported_in_one_line(piezo, words):
    done = piezo(*words.split())
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert done.err.startswith("piezo")


def test_an_interrupt_while_a_command_loads_is_reported_in_one_line():
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "effects"]
    listing = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}
    loading = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=listing)
    assert any("argparse" in line for line in loading.stderr)  # the first import of the command, others follow
    loading.send_signal(signal.SIGINT)
    _, after = loading.communicate(timeout=60.0)
    assert [line for line in after.splitlines() if not line.startswith("import time")] == ["piezo: interrupted"]
    assert loading.returncode == INTERRUPTED


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_without_greek_letters_does_not_end_a_command(encoding):
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "effects", "creep"]
    done = subprocess.run(command, capture_output=True, check=False, env={**os.environ, "PYTHONIOENCODING": encoding})
    assert (done.returncode, done.stderr) == (0, b"") and b"1/decade" in done.stdout


@pytest.mark.parametrize("words", [["--help"], ["identify", "--help"], ["--version"], ["effects"]])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_does_not_fit_on_the_disk_is_an_error(words, unbuffered):
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", *words]
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as disk:
        done = subprocess.run(command, stdout=disk, stderr=subprocess.PIPE, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr == "piezo: [Errno 28] No space left on device\n"


def test_the_end_of_a_reader_has_a_status_of_its_own():
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "effects"]
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (BROKEN_PIPE, b"")


def test_a_closed_output_pipe_is_not_an_error():
    done = subprocess.run(
        f"{sys.executable} -m piezo_hysteresis.cli.main effects | head -1",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Catalogue" in done.stdout
    assert done.stderr == ""


def test_a_reader_that_leaves_early_takes_no_file_with_it(folder, tmp_path):
    answer = tmp_path / "answer.json"
    command = f"identify {folder} -o {tmp_path / 'model.yaml'} --json {answer}"
    subprocess.run(f"{sys.executable} -m piezo_hysteresis.cli.main {command} | head -1", shell=True, check=False)
    assert json.loads(answer.read_text())["schema"] == 1


@pytest.fixture(scope="module")
def files(tmp_path_factory, folder):
    """Good and bad files by name."""
    place = tmp_path_factory.mktemp("files")
    fine = model_file.save(
        Model((BoucWen(), Arx(a=[-0.5], b=[0.25])), 2e-5, displacement_scale=1e-4), place / "fine.yaml"
    )
    text = "".join(line for line in fine.read_text().splitlines(True) if " hash:" not in line)
    (place / "broken.yaml").write_text("/**: [1, 2\n")
    (place / "extra.yaml").write_text(text.replace("        gamma:", "        gama: 1.0\n        gamma:"))
    (place / "missing.yaml").write_text("".join(line for line in text.splitlines(True) if " gamma:" not in line))
    (place / "unstable.yaml").write_text(
        "".join("        a: [-1.5]\n" if line.lstrip().startswith("a:") else line for line in text.splitlines(True))
    )
    (place / "empty.npz").write_bytes(b"")
    (place / "list.json").write_text("[1]")
    (place / "node.yaml").write_text("driver_node:\n  ros__parameters:\n    stage: simulated\n")
    os.mkfifo(place / "pipe.csv")
    os.mkfifo(place / "zipped.npz")
    t = np.arange(50.0)
    recording.write(Experiment((Record(t, 1e-6 * t, 1e-6, phase="fast"),)), place / "fast")
    recording.write(Experiment((Record(t, 0 * t, 1e-3, phase="still"),)), place / "still")
    recording.write(Experiment((Record(0 * t, 1e-9 * t, 1e-3, phase="undriven"),)), place / "undriven")
    recording.write(Experiment((Record(t[:5], 1e-6 * t[:5], 1e-3, phase="short"),)), place / "short")
    return {**{p.name.partition(".")[0]: p for p in place.iterdir()}, "experiment": folder, "place": place}


NOBODY = "there is no home folder of that user, expected another path"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulate -o ~no_such_user/x", NOBODY),
        ("simulate -o {place}/x --plant ~no_such_user/x", NOBODY),
        ("identify {experiment} -o {place}/x.yaml --json ~no_such_user/x", NOBODY),
        ("validate {fine} ~no_such_user/x", NOBODY),
        ("validate {fine} {experiment} --figures ~no_such_user/x", NOBODY),
        ("diagnose --stage ~no_such_user/x -o {place}/x", NOBODY),
        ("compensate {fine} ~no_such_user/x", NOBODY),
        ("history ~no_such_user/x", NOBODY),
        ("report {experiment} --answer ~no_such_user/x", NOBODY),
        ("fleet {experiment} -o ~no_such_user/x", NOBODY),
        ("validate {place}/none.yaml {experiment}", "expected a model file"),
        ("validate {broken} {experiment}", "broken.yaml"),
        ("validate {extra} {experiment}", "gama"),
        ("validate {missing} {experiment}", "gamma"),
        ("validate {unstable} {experiment}", "arx.a"),
        ("validate {fine} {place}/nothing", "expected a recording"),
        ("validate {fine} {empty}", "empty.npz"),
        ("validate {fine} {fast}", "decimate"),
        ("validate {fine} {experiment} --json {place}/no/where.json", "is no folder, expected one that exists"),
        ("validate {fine} {experiment} --column voltage", "--column: got 'voltage', expected NAME=VALUE"),
        ("validate {fine} {experiment} --column wolt=1", "wolt"),
        ("validate {fine} {experiment} --unit displacement=inch", "inch"),
        ("validate {fine} {experiment} --decimate noise=few", "a whole number"),
        ("validate {fine} {experiment} --decimate noize=2", "no phase 'noize', expected one of"),
        ("validate {fine} {experiment} --rows 5", "expected FROM:TO"),
        ("validate {fine} {experiment} --sample-period -1", "expected a positive time"),
        ("validate {fine} {experiment} --phase 0=a --phase b", "TIME=NAME"),
        ("validate {fine} {experiment} --phase nan=a", "--phase: got the times nan, expected finite ones"),
        ("compensate {fine} {pipe} -o {place}/c.npz", "expected a regular file"),
        ("compensate {fine} {zipped} -o {place}/c.npz", "expected a regular file"),
        ("history {pipe}", "expected a regular file"),
        ("report {experiment} --answer {pipe} -o {place}/r.html", "expected a regular file"),
        ("identify {experiment} -o {place}/x.yaml --json {place}/x.yaml", "expected another file"),
        ("identify {experiment} -o {place}/x.yaml --taps 7", "--taps: got 7 for a stage of one axis"),
        ("report {experiment} --answer {fine}", "no JSON"),
        ("report {experiment} --answer {list}", "got a list"),
        ("report {experiment} --model before={place}/none.yaml", "expected a model file"),
        ("import {experiment} -o {experiment}", "choose another one or remove it"),
        ("simulate -o {place}/s --plant {place}/none.yaml", "expected a YAML file"),
        ("simulate -o {place}/s --plant {list}", "got a list"),
        ("simulate -o {place}/s --plant {fine}", "unknown quantity"),
        ("simulate -o {place}/s --plant {fine}", "expected names without the heading of a ROS node"),
        ("diagnose --stage {node} -o {place}/s", "'ros__parameters' under the heading '/**:'"),
        ("diagnose --stage {node} -o {place}/s --correction {place}/c.npz", "a name that ends in .yaml"),
        ("simulate -o {place}/s --plant {broken}", "broken YAML"),
        ("simulate -o {place}/s --noise -1", "--noise"),
        ("simulate -o {place}/s --sample-period 1", "sample period"),
        ("record {place}/none.yaml short -o {place}/r", "none.yaml: No such file or directory, expected a YAML file"),
        ("history {place}/none.csv", "none.csv: cannot be read (No such file or directory), expected"),
        ("view {experiment} --no-browser --port -1", "port: got -1, expected 0 to 65535"),
        ("effects creeep", "unknown effect 'creeep'"),
    ],
)
def test_bad_input_is_reported_in_one_line(piezo, files, line, words):
    done = piezo(*(word.format_map(files) for word in line.split()))
    assert done.status == 2
    assert words in done.err
    assert done.err.startswith("piezo: ")
    assert done.err.count("\n") == 1


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("identify {undriven} -o {place}/new.yaml", "drive does not move"),
        ("identify {still} -o {place}/new.yaml", "displacement never changes"),
        ("validate {fine} {undriven} --json {place}/new.json", "drive does not move"),
        ("validate {fine} {still} --json {place}/new.json", "every sample"),
        ("recalibrate {fine} {undriven} -o {place}/new.yaml", "drive does not move"),
        ("recalibrate {fine} {still} -o {place}/new.yaml", "displacement never changes"),
        ("recalibrate {fine} {short} -o {place}/new.yaml", "noise of 16 samples or more"),
        ("diagnose {undriven} -o {place}/new.yaml", "drive does not move"),
        ("report {still} --model {fine} -o {place}/new.html", "every sample"),
    ],
)
def test_data_that_do_not_determine_the_result_exit_with_1(piezo, files, line, words):
    done = piezo(*(word.format_map(files) for word in line.split()))
    assert done.status == 1
    assert done.out == ""
    (error,) = (text for text in done.err.splitlines() if text.startswith("piezo: "))
    assert words in error
    assert not list(files["place"].glob("new*"))


def test_a_diagnosis_of_data_that_allow_no_verdict_exits_with_1(piezo, files, tmp_path):
    page = tmp_path / "page.html"
    done = piezo("diagnose", files["still"], "--model", files["fine"], "--report", page)
    assert done.status == 1
    assert "No verdict is possible, because of the data" in done.out
    assert page.exists()
    assert done.out.splitlines()[-1] == "Severe findings above: check the recording before you use it."


@pytest.mark.parametrize(
    "line",
    [
        "",
        "teleport",
        "validate",
        "identify --orders 8",
        "simulate --protocol long -o x",
        "simulate -o x --seed -1",
        "simulate -o x --hidden -5",
        "emulate gcs2 --seed -3",
    ],
)
def test_a_command_line_that_makes_no_sense_exits_with_2(piezo, line):
    done = piezo(*line.split())
    assert done.status == 2
    assert "Traceback" not in done.err
