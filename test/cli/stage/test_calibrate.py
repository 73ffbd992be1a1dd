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

"""``piezo calibrate`` measures a card that is wired back to itself, and the driver reads what it wrote."""

import signal

import numpy as np
import pytest

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
pytest.importorskip("grpc")

from piezo_hysteresis.acquisition.stage_lock import StageLock
from piezo_hysteresis.emulators.daqmx.card import Card
from piezo_hysteresis.emulators.daqmx.server import DaqmxServer
from piezo_hysteresis.model.parameter_file import parameters
from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
from piezo_hysteresis.stage.daqmx.stage import DaqmxStage
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 2e-5
WAVE = 2.0 - 2.0 * np.cos(2 * np.pi * np.arange(4000) / 2000)


@pytest.fixture
def card():
    return Card(SimulatedStage(seed=3), speed=float("inf"))


@pytest.fixture
def address(card):
    with DaqmxServer(card) as server:
        yield f"127.0.0.1:{server.port}"


def test_the_delay_that_was_written_is_taken_off(piezo, address, tmp_path):
    file = tmp_path / "card.yaml"
    done = piezo("calibrate", "Dev1", "--server", address, "--wired-input", "ai2", "-o", str(file))
    assert done.status == 0, done.err
    assert "2.00 samples" in done.out
    written = parameters(file.read_text())
    delay = written["/**"]["nidaqmx.io_delay"]
    assert delay == pytest.approx(2 * PERIOD, abs=0.05 * PERIOD)
    wiring = {"displacement_input": "ai2", "sensor_gain": 1.0, "server": address}
    stage = DaqmxStage(DaqmxSetup("Dev1", max_slew_rate=1e6, io_delay=delay, **wiring))
    got = stage.exchange(np.concatenate((WAVE, np.zeros(5000))))
    np.testing.assert_allclose(got.displacement, got.voltage, atol=2e-4)
    stage.close()


def test_an_existing_file_is_replaced_on_request_only(piezo, address, tmp_path):
    file = tmp_path / "card.yaml"
    file.write_text("mine")
    words = ("calibrate", "Dev1", "--server", address, "--wired-input", "ai2", "-o", str(file))
    refused = piezo(*words)
    assert refused.status == 2 and "--force" in refused.err
    assert file.read_text() == "mine"
    assert piezo(*words, "--force").status == 0
    assert "io_delay" in file.read_text()


def test_a_card_that_a_driver_holds_is_left_alone(piezo, address, tmp_path):
    setup = DaqmxSetup("Dev1", server=address, max_slew_rate=1e6)
    stage = DaqmxStage(setup)
    stage.set_voltage(3.0)
    lock = StageLock([f"device {stage.description.name}"])
    file = tmp_path / "card.yaml"
    done = piezo("calibrate", "Dev1", "--server", address, "--wired-input", "ai2", "-o", str(file))
    assert done.status == 2 and "is held by process" in done.err
    assert not file.exists()
    stage.leave()
    lock.release()
    again = DaqmxStage(setup)
    assert again.voltage == pytest.approx(3.0, abs=1e-3)
    again.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_signals_leave_no_output_energised(piezo, card, address, tmp_path, monkeypatch, number):
    """Neither the first one, in the measurement, nor others while the output is brought to its safe voltage."""
    file, exchange, close = tmp_path / "card.yaml", DaqmxStage.exchange, DaqmxStage.close
    seen = []

    def interrupted(stage, drive):
        exchange(stage, drive)
        seen.append(card.voltage)
        signal.raise_signal(number)

    def interrupted_again(stage):
        signal.raise_signal(number)
        close(stage)

    before = signal.getsignal(number)
    monkeypatch.setattr(DaqmxStage, "exchange", interrupted)
    monkeypatch.setattr(DaqmxStage, "close", interrupted_again)
    done = piezo("calibrate", "Dev1", "--server", address, "--wired-input", "ai2", "-o", file)
    assert done.status == 130
    assert done.err.strip().endswith("Dev1 is at 0 V; nothing was written")
    assert seen[0] > 0.0
    assert card.voltage == 0.0
    assert not file.exists()
    assert signal.getsignal(number) is before
    StageLock([f"device {DaqmxSetup('Dev1', max_slew_rate=1.0).description().name}"]).release()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--wired-input", "ai0"), "wire the output"),
        (("--wired-input", "ai9"), "does not exist"),
        (("-o", "/"), "exists already"),
        (("--sample-period", "0"), "expected a positive time"),
    ],
)
def test_a_failed_calibration_gives_one_line(piezo, address, tmp_path, words, reason):
    arguments = ("--wired-input", "ai2", "-o", str(tmp_path / "card.yaml"))
    done = piezo("calibrate", "Dev1", "--server", address, *arguments, *words)
    assert done.status == 2
    assert done.err.count("\n") == 1
    assert reason in done.err
