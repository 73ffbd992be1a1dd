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

"""A driver that dies or stands still leaves no device energised: its keeper goes to the safe voltage, slew kept."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from subprocess import PIPE

import numpy as np
import pytest

from benchmarks.wire import PERIOD, RAMP, SAFE_WITHIN, SLEW, TOP, check_wire, device, driver_process, settings
from piezo_hysteresis.acquisition.safety import keeper_link
from piezo_hysteresis.acquisition.session import DriverSession
from piezo_hysteresis.stage.back_ends import BACK_ENDS
from piezo_hysteresis.stage.opening import Opening

pytestmark = pytest.mark.device

TIMEOUT = 0.5
BLIND = {"voltage_input": "", "assume_safe": True}
"""Of a card that does not report its output, and whose user has said that it is at the safe voltage at the start."""


def wait(condition, what, folder, timeout=60.0):
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"waited {timeout:g} s for {what}\n{(folder / 'log').read_text()}")
        time.sleep(2e-3)


@contextmanager
def driver_in_motion(folder, word, moved_to=3.0, blind=False):
    """The process of a driver whose stage has passed a voltage [V], and the amplifier; killed at the end."""
    with device(word, **({"reads_back": False} if blind else {})) as (name, parameters, amplifier, _):
        process = driver_process(folder, name, parameters | (BLIND if blind else {}), TIMEOUT)
        try:
            wait(lambda: amplifier.output > moved_to, "motion", folder)
            yield process, amplifier
        finally:
            process.kill()
            process.wait()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("word", ["gcs2", "nidaqmx"])
def test_a_driver_that_is_killed_or_stopped_in_motion(tmp_path, word, number):
    if word == "nidaqmx":
        pytest.importorskip("nidaqmx")
    with driver_in_motion(tmp_path, word) as (process, amplifier):
        process.send_signal(number)
        begin = amplifier.wire.size
        wait(lambda: "is at its safe voltage" in (tmp_path / "log").read_text(), "the keeper", tmp_path)
        wire = amplifier.wire
        assert abs(wire[-1]) <= SAFE_WITHIN
        check_wire(wire)
        moved = np.flatnonzero(np.abs(np.diff(wire[begin:])) > 0)
        assert moved.size * PERIOD < 3 * 6.0 / RAMP + 2.0
        if number == signal.SIGSTOP:
            process.send_signal(signal.SIGCONT)
            assert process.wait(30.0) != 0
            assert abs(amplifier.output) <= SAFE_WITHIN, "what was stopped moves nothing when it goes on"


SLOW = {"keeper_timeout": TIMEOUT, "ramp_rate": 5.0, "voltage_max": TOP}
"""Settings of a driver whose keeper needs a second to the safe voltage."""
AT_THREE_VOLTS = """
import json, sys, time
from benchmarks.wire import DriverSession, settings
word, parameters, changes = json.loads(sys.argv[1])
session = DriverSession(settings(word, **changes), parameters, "place")
session.start(node_clock=time.time_ns, deliver=lambda block: None, fail=print, subscribers=lambda: 1).ramp_to(3.0)
time.sleep(100.0)
"""


def test_a_new_driver_waits_until_the_keeper_of_a_killed_one_has_ended():
    """It opened the stage while the keeper moved it, and its stream began with a step of 3 V."""
    pytest.importorskip("nidaqmx")
    with device("nidaqmx") as (name, parameters, amplifier, _):
        order = json.dumps([name, parameters, SLOW])
        with subprocess.Popen([sys.executable, "-c", AT_THREE_VOLTS, order]) as process:
            while amplifier.output < 2.9:
                time.sleep(0.01)
            process.kill()
        # without a keeper of its own: a busy machine would let it end this process, which is the driver here
        session = DriverSession(settings(name, **SLOW | {"keeper_timeout": 0.0}), parameters, "place")
        assert session.stage.voltage == 0.0
        session.start(node_clock=time.time_ns, deliver=lambda block: None, fail=print, subscribers=lambda: 1)
        time.sleep(0.2)
        session.close()
        check_wire(amplifier.wire)


def test_a_driver_that_goes_on_while_its_keeper_acts_leaves_the_stage_alone(tmp_path):
    with driver_in_motion(tmp_path, "gcs2") as (process, amplifier):
        process.send_signal(signal.SIGSTOP)
        wait(lambda: "bringing" in (tmp_path / "log").read_text(), "the keeper", tmp_path)
        process.send_signal(signal.SIGCONT)
        assert process.wait(30.0) != 0
        assert "the keeper of the stage has ended" in (tmp_path / "log").read_text()
        assert abs(amplifier.output) <= SAFE_WITHIN
        check_wire(amplifier.wire)


def test_a_driver_that_is_interrupted_again_and_again_ends_safe(tmp_path):
    with driver_in_motion(tmp_path, "gcs2") as (process, amplifier):
        while process.poll() is None:
            process.send_signal(signal.SIGTERM)
            time.sleep(0.02)
        assert process.wait(30.0) in (130, -signal.SIGTERM), (tmp_path / "log").read_text()
        # the keeper says it, if the driver was ended before it could
        wait(lambda: "is at its safe voltage" in (tmp_path / "log").read_text(), "the safe voltage", tmp_path)
        assert abs(amplifier.output) <= SAFE_WITHIN
        check_wire(amplifier.wire)


def test_a_driver_whose_keeper_is_killed_ends_safe(tmp_path):
    with driver_in_motion(tmp_path, "gcs2", moved_to=1.0) as (process, amplifier):
        children = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=True)
        os.kill(int(children.stdout.split()[0]), signal.SIGKILL)
        assert process.wait(30.0) == 2
        assert "the keeper of the stage has ended" in (tmp_path / "log").read_text()
        assert abs(amplifier.output) <= SAFE_WITHIN
        check_wire(amplifier.wire)


def test_a_driver_that_goes_on_where_its_keeper_cannot_act_makes_the_stage_safe_itself(tmp_path):
    """A keeper that does not know the voltage does not end the only process that does."""
    pytest.importorskip("nidaqmx")
    with driver_in_motion(tmp_path, "nidaqmx", blind=True) as (process, amplifier):
        process.send_signal(signal.SIGSTOP)
        wait(lambda: "switch the amplifier off by hand" in (tmp_path / "log").read_text(), "the keeper", tmp_path)
        process.send_signal(signal.SIGCONT)
        assert process.wait(30.0) not in (0, -signal.SIGKILL)
        assert abs(amplifier.output) <= SAFE_WITHIN
        check_wire(amplifier.wire)


@contextmanager
def keeper_of_a_held_voltage(kind="gcs2", blind=False):
    """A keeper that is ready, and the amplifier of its stage, whose driver has left it at 3 V."""
    with device(kind, **({"reads_back": False} if blind else {})) as (word, parameters, amplifier, _):
        parameters |= BLIND if blind else {}
        stage = BACK_ENDS[word].open(parameters, Opening(PERIOD))
        stage.set_voltage(3.0)
        limits = {"voltage_min": 0.0, "voltage_max": TOP, "max_slew_rate": SLEW}
        order = {"stage": word, "values": parameters, "sample_period": PERIOD, "limits": limits, "ramp_rate": RAMP}
        order |= {"timeout": 60.0, "ends_driver": False, "driver": 0}
        command = [sys.executable, "-m", "piezo_hysteresis.acquisition.safety.keeper"]
        with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=PIPE) as keeper:
            try:
                keeper.stdin.write(json.dumps(order).encode() + b"\n")
                keeper.stdin.flush()
                assert keeper.stdout.readline() == b"ready\n"
                stage.leave()
                assert abs(amplifier.output - 3.0) <= SAFE_WITHIN
                yield keeper, amplifier
            finally:
                keeper.kill()


def test_a_keeper_acts_also_when_nobody_reads_its_messages_any_more():
    """The terminal or the launch program of a driver may end together with it."""
    with keeper_of_a_held_voltage() as (keeper, amplifier):
        keeper.stderr.close()
        keeper.stdout.close()
        keeper.stdin.close()
        keeper.wait(30.0)
        assert abs(amplifier.output) <= SAFE_WITHIN


def test_a_keeper_acts_also_when_the_reader_of_its_messages_stands_still():
    """A paused terminal took no more lines; it stopped the driver, and the keeper in its first message, too."""
    with keeper_of_a_held_voltage() as (keeper, amplifier):
        full = os.open(f"/proc/{keeper.pid}/fd/2", os.O_WRONLY | os.O_NONBLOCK)
        for size in (4096, 1):
            with suppress(BlockingIOError):
                while True:
                    os.write(full, b"." * size)
        os.close(full)
        keeper.stdin.close()
        assert keeper.wait(30.0) == 0
        assert abs(amplifier.output) <= SAFE_WITHIN


def test_a_keeper_of_a_driver_without_stderr_writes_its_messages_nowhere(monkeypatch):
    """Without the descriptor 2, the connection to the device would get this number, and the messages."""
    monkeypatch.setattr(sys, "stderr", None)
    assert keeper_link._terminal() == subprocess.DEVNULL


def test_a_keeper_never_assumes_where_a_stage_stands():
    pytest.importorskip("nidaqmx")
    with keeper_of_a_held_voltage("nidaqmx", blind=True) as (keeper, amplifier):
        _, said = keeper.communicate(timeout=30.0)
        assert keeper.returncode == 1
        assert b"the voltage of the stage is unknown; switch the amplifier off by hand" in said
        assert b"is at its safe voltage" not in said
        assert amplifier.output == pytest.approx(3.0, abs=SAFE_WITHIN)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_keeper_that_is_asked_to_end_still_watches_its_driver(number):
    """A service manager or a terminal asks the whole group of the driver, which may be unable to act."""
    with keeper_of_a_held_voltage() as (keeper, amplifier):
        keeper.send_signal(number)
        time.sleep(0.1)
        keeper.stdin.close()
        assert keeper.wait(30.0) == 0
        assert abs(amplifier.output) <= SAFE_WITHIN


@pytest.mark.parametrize("sent", [b"", b"order"])
def test_a_keeper_whose_driver_ends_first_ends_without_a_word(sent):
    order = {"stage": "simulated", "sample_period": 0.0, "limits": {}, "ramp_rate": 1.0}
    order["values"] = {row.name: row.value for row in BACK_ENDS["simulated"].rows}
    keeper = subprocess.Popen(
        [sys.executable, "-m", "piezo_hysteresis.acquisition.safety.keeper"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    keeper.stdout.close()
    _, said = keeper.communicate(json.dumps(order).encode() + b"\n" if sent else b"", timeout=30.0)
    assert (keeper.returncode, said) == (0, b"")
