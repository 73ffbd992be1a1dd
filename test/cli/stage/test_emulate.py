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

"""``piezo emulate`` is a device for whoever connects, until it is interrupted."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
from piezo_hysteresis.stage.daqmx.stage import DaqmxStage
from piezo_hysteresis.stage.gcs2.setup import Gcs2Setup
from piezo_hysteresis.stage.gcs2.stage import Gcs2Stage


def opened(device, port):
    if device == "gcs2":
        return Gcs2Stage(Gcs2Setup("127.0.0.1", port, amplifier_gain=20.0, max_slew_rate=1e6))
    return DaqmxStage(DaqmxSetup("Dev1", server=f"127.0.0.1:{port}", max_slew_rate=1e6))


@pytest.mark.parametrize("device", ["gcs2", "nidaqmx"])
def test_a_process_that_is_a_device(device):
    if device == "nidaqmx":
        pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "emulate", device, "--port", "0", "--noise", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            said = process.stdout.readline()
            stage = opened(device, int(re.search(r"127\.0\.0\.1:(\d+)", said)[1]))
            stage.set_voltage(3.0)
            assert stage.voltage == 3.0
            assert np.isfinite(stage.read_displacement())
            stage.close()
        finally:
            process.send_signal(signal.SIGINT)
        assert "ended" in process.stdout.read()
        assert process.wait() == 0


def test_two_controllers_at_a_time_are_two_devices():
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "emulate", "gcs2", "--port", "0"]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    names = set()
    for process in processes:
        with process:
            try:
                stage = opened("gcs2", int(re.search(r"127\.0\.0\.1:(\d+)", process.stdout.readline())[1]))
                names.add(stage.description.name)
                stage.close()
            finally:
                process.send_signal(signal.SIGINT)
    assert len(names) == 2, "a driver would take the second one for a device that has a driver already"


@pytest.mark.parametrize(
    "words",
    [
        ("gcs2", "--fault", "earthquake"),
        ("gcs2", "--fault", "slow=-1"),
        ("gcs2", "--fault", "trickle=nan"),
        ("gcs2", "--fault", "error=1.5"),
        ("gcs2", "--fault", "link_lost=7"),
        ("gcs2", "--fault", "slow@POS?:0"),
        ("gcs2", "--command-per-volt", "0"),
        ("nidaqmx", "--servo-time", "0.001"),
        ("nidaqmx", "--port", "70000"),
        ("nidaqmx", "--fault", "servo_on"),
        ("gcs2", "--port", "99999"),
        ("gcs2", "--servo-time", "0"),
        ("gcs2", "--noise", "-1"),
    ],
)
def test_an_invalid_emulator_option_gives_one_line(piezo, words):
    if words == ("nidaqmx", "--port", "70000"):
        pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
    done = piezo("emulate", *words)
    assert done.status == 2
    assert done.err.count("\n") == 1
    assert "expected" in done.err or "cannot listen" in done.err
    assert "--port" in words or done.err.startswith(f"piezo: {words[1]}: got"), "the option is named as it was given"
