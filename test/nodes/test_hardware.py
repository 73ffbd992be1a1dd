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

"""The driver as a process on a controller and on a card: gaps, streams, lost links, and the safe voltage."""

import re
import signal
import time
from contextlib import contextmanager

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from piezo_hysteresis.emulators.fault import Faults
from piezo_hysteresis.emulators.gcs2.controller import Controller
from piezo_hysteresis.emulators.gcs2.faults import FAULTS
from piezo_hysteresis.emulators.gcs2.server import Gcs2Server
from piezo_hysteresis.model.model_file import load
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

from .identification.test_identification_node import Identification

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
RAMP_RATE = 20.0
GAIN = 20.0
SERIAL = f"{time.monotonic_ns()}"
"""Of a controller that no other program on this machine drives."""
LSB = 1e-3
"""Converters round the drive to less than this [V]."""


class Driven:
    """A driver process, its diagnostics, and the emulated device that it drives."""

    def __init__(self, lab, stage, **parameters):
        self.lab, self.reports = lab, lab.diagnostics()
        self.process = lab.driver(stage=stage, ramp_rate=RAMP_RATE, **parameters)
        self.samples, self.statuses = lab.streaming(), lab.statuses()

    def play(self, name, drive):
        """Send a waveform, and return its samples when it is done."""
        self.lab.send(drive, name, PERIOD)
        ended = ("done", "refused", "stopped")
        self.lab.wait(lambda: set(ended) & set(self.lab.states(self.statuses, name)), f"the end of {name}")
        assert self.lab.states(self.statuses, name)[-1] == "done"
        number = self.lab.value(self.statuses, name, "done", "phase")
        self.lab.wait(lambda: self.samples.newest.phase[-1] > number, "the hold after it")
        blocks = [block for block in self.samples.blocks if (block.phase == number).any()]
        inside = np.concatenate([block.phase for block in blocks]) == number
        voltage, index = (np.concatenate([getattr(block, k) for block in blocks])[inside] for k in ("voltage", "index"))
        return blocks, voltage, index.astype(np.int64)

    def await_failure(self, *words):
        """Wait until the driver has given the device up and said all the words."""
        self.lab.wait(lambda: self.lab.state() == "unconfigured", "the end of the failed stage")
        for word in words:
            pattern = re.compile(word)
            self.lab.wait(
                lambda p=pattern: any(p.search(s.message) for a in self.reports for s in a.status), f"'{word}'"
            )

    def configure_again(self):
        count = len(self.samples.blocks)
        assert self.lab.transition("configure")
        assert self.lab.transition("activate")
        self.lab.wait(lambda: len(self.samples.blocks) > count + 3, "samples again")

    def in_force(self, name):
        request = GetParameters.Request(names=[f"in_force.{name}"])
        (value,) = self.lab.call(GetParameters, "driver_node/get_parameters", request).values
        return parameter_value_to_python(value)

    def end(self, number, moves):
        """Signal the driver in mid-waveform, once the device moves."""
        self.lab.send(np.concatenate((np.linspace(0, 4, 3000), np.full(100_000, 4.0))), "long", PERIOD)
        self.lab.wait(moves, "motion")
        self.process.signal(number)
        assert self.process.wait() == 0, self.process.output


def test_the_name_that_a_controller_gives_forges_no_line(lab):
    """The answer to *IDN? is the name of the stage: in logs, diagnostics and parameters."""
    serial = "7\x1b]0;title\x07 [ERROR] forged\x9b2J"
    with Gcs2Server(Controller(SimulatedStage(seed=3, sample_period=PERIOD), serial=serial)) as server:
        address = {"gcs2__host": server.host, "gcs2__port": server.port, "gcs2__max_slew_rate": 1e6}
        driven = Driven(lab, "gcs2", gcs2__amplifier_gain=GAIN, **address)
        assert "forged" in driven.in_force("stage")
        assert driven.in_force("stage").isprintable()
        lab.wait(lambda: any(s.hardware_id for report in list(driven.reports) for s in report.status), "its name")
        named = {s.hardware_id for report in list(driven.reports) for s in report.status}
        assert all(name.isprintable() for name in named)
        assert driven.samples.newest.frame.isprintable()
        assert "forged" in driven.process.output
        assert all(line.isprintable() for line in driven.process.output.split("\n"))


def hill(top, size):
    return 0.5 * top * (1 - np.cos(2 * np.pi * np.arange(size) / size))


def test_a_controller_with_memory(lab):
    faults = [FAULTS.parse("link_lost@DRR?:4")]
    controller = Controller(
        SimulatedStage(seed=3, sample_period=PERIOD), serial=SERIAL, recorder_points=8 * 4000, faults=faults
    )

    def voltage_now():
        return float(controller.carry_out("VOL? 1").lines[0].partition("=")[2]) / GAIN

    with Gcs2Server(controller) as server:
        address = {"gcs2__host": server.host, "gcs2__port": server.port, "gcs2__max_slew_rate": 1e6}
        driven = Driven(lab, "gcs2", gcs2__amplifier_gain=GAIN, gcs2__points_per_command=500, **address)
        assert "E-727.EMULATED" in driven.in_force("stage")
        assert driven.in_force("voltage_max") == 10.0

        drive = hill(5.0, 9000)
        blocks, voltage, index = driven.play("hill", drive)
        assert [block.size for block in blocks] == [4000, 4000, 1000]
        np.testing.assert_allclose(voltage, drive, atol=LSB)
        assert (voltage != drive).any(), "measured, not commanded"
        assert all(block.follows_gap for block in blocks), "uploading takes time, and it is reported"
        assert (np.diff(index) > 1).sum() == 2

        lab.send(hill(2.0, 500), "cut", PERIOD)
        driven.await_failure("the link was closed from the other side", "brought to its safe voltage, 0 V")
        assert voltage_now() == 0.0
        driven.configure_again()
    driven.await_failure("lost the link|closed from the other side|cannot connect", "voltage of the stage is unknown")
    with Gcs2Server(controller, port=server.port):
        driven.configure_again()
        driven.end(signal.SIGINT, lambda: voltage_now() > 0.5)
        assert voltage_now() == 0.0
        assert controller.carry_out("\x09").lines == ["0x0"], "the generator stands"


def test_a_card_that_streams(lab):
    pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
    pytest.importorskip("grpc")
    from piezo_hysteresis.emulators.daqmx.card import Card
    from piezo_hysteresis.emulators.daqmx.faults import FAULTS as NI_FAULTS
    from piezo_hysteresis.emulators.daqmx.server import DaqmxServer

    card = Card(SimulatedStage(seed=3, sample_period=PERIOD))
    with DaqmxServer(card) as server:
        wiring = {
            "nidaqmx__server": f"127.0.0.1:{server.port}",
            "nidaqmx__device": "Dev1",
            "nidaqmx__max_slew_rate": 1e6,
        }
        wiring |= {"nidaqmx__voltage_input": "ai1", "nidaqmx__lead": 1.5, "sample_period": PERIOD}
        driven = Driven(lab, "nidaqmx", block_duration=0.1, **wiring)
        assert driven.in_force("stage").endswith("Dev1/ao0")

        drive = hill(5.0, 9000)
        blocks, voltage, index = driven.play("hill", drive)
        np.testing.assert_allclose(voltage[: index.size], drive[index - index[0]], atol=LSB)
        assert (voltage != drive[index - index[0]]).any(), "measured, not commanded"
        assert not any(block.follows_gap for block in blocks)
        card.faults = Faults([NI_FAULTS.parse("device_lost@ReadAnalogF64:1")])
        driven.await_failure("Device not available", "safe voltage, 0 V")
        assert card.voltage == 0.0
        driven.configure_again()
    driven.await_failure("Failed to connect|Socket closed|no answer", "voltage of the stage is unknown")
    with DaqmxServer(card, port=server.port):
        driven.configure_again()
        driven.end(signal.SIGTERM, lambda: card.voltage > 0.5)
        assert card.voltage == 0.0
        assert driven.samples.steepest(PERIOD) <= max(RAMP_RATE, 4 / (2999 * PERIOD)) * 1.1


@contextmanager
def emulated_controller():
    controller = Controller(SimulatedStage(seed=3, sample_period=PERIOD), serial=SERIAL)
    with Gcs2Server(controller) as server:
        address = {"gcs2__host": server.host, "gcs2__port": server.port, "gcs2__max_slew_rate": 1e6}
        yield {
            "stage": "gcs2",
            "gcs2__max_slew_rate": 1e6,
            "gcs2__amplifier_gain": GAIN,
            "gcs2__points_per_command": 500,
            **address,
        }


@contextmanager
def emulated_card():
    pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
    from piezo_hysteresis.emulators.daqmx.card import Card
    from piezo_hysteresis.emulators.daqmx.server import DaqmxServer

    with DaqmxServer(Card(SimulatedStage(seed=3, sample_period=PERIOD))) as server:
        wiring = {"nidaqmx__server": f"127.0.0.1:{server.port}", "nidaqmx__device": "Dev1", "nidaqmx__lead": 1.5}
        wiring["nidaqmx__max_slew_rate"] = 1e6
        yield {
            "stage": "nidaqmx",
            "nidaqmx__voltage_input": "ai1",
            "sample_period": PERIOD,
            "block_duration": 0.2,
            **wiring,
        }


@pytest.mark.soak
@pytest.mark.parametrize("emulated", [emulated_controller, emulated_card], ids=["gcs2", "nidaqmx"])
def test_from_an_unknown_stage_to_its_model_and_its_gap_through_the_nodes(lab, emulated):
    with emulated() as parameters:
        lab.driver(**parameters)
        identification = Identification(lab)
        path = identification.begin()
        ended = identification.await_state("done", "failed", timeout=600.0)
        assert "% of range" in ended.message, ended.message
        model = load(path / "identification.yaml")
        plant = PlantParameters()
        assert float(model.provenance["free_run_error"]) < 1.5 * plant.sensor.noise * plant.full_stroke
        assert identification.ask("diagnose").success
        identification.await_state("fitting")
        ended = identification.await_state("done", "failed", timeout=600.0)
        assert ended.message.startswith("nothing_missing: "), ended.message
