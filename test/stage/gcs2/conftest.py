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

"""An emulated controller behind a real port, and the back end connected to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from piezo_hysteresis.emulators.gcs2.controller import Controller
from piezo_hysteresis.emulators.gcs2.faults import FAULTS
from piezo_hysteresis.emulators.gcs2.server import Gcs2Server
from piezo_hysteresis.stage.gcs2.client import Client
from piezo_hysteresis.stage.gcs2.connection import Connection
from piezo_hysteresis.stage.gcs2.setup import Gcs2Setup
from piezo_hysteresis.stage.gcs2.stage import Gcs2Stage
from piezo_hysteresis.stage.simulated import SimulatedStage

SERVO_TIME = 50e-6
GAIN = 20.0
"""Of the simulated amplifier."""


class Listening(Controller):
    """An emulated controller that keeps the commands it received."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.heard = []

    def carry_out(self, line):
        self.heard.append(line)
        return super().carry_out(line)


@dataclass
class Bench:
    """A controller, its port, the back end, and a second link of an observer."""

    controller: Listening
    server: Gcs2Server
    stage: Gcs2Stage | None = None

    def setup(self, **changes) -> Gcs2Setup:
        scales = {"amplifier_gain": GAIN, "points_per_command": 100, "timeout": 5.0, "max_slew_rate": 1e9}
        return Gcs2Setup(self.server.host, self.server.port, **scales | changes)

    def observer(self) -> Client:
        return Client(Connection(self.server.host, self.server.port, 2.0))

    @property
    def voltage(self) -> float:
        """Drive in force [V], asked for over a link of its own."""
        client = self.observer()
        try:
            return client.number("VOL? 1") / GAIN
        finally:
            client.connection.close()


@pytest.fixture
def bench():
    """Make benches: emulated controller with faults, back end opened with changes of the setup."""
    made = []

    def make(*faults: str, plant=None, seed=3, speed=math.inf, opened=True, controller=None, **changes) -> Bench:
        simulated = SimulatedStage(plant, seed=seed, sample_period=SERVO_TIME)
        options = {"faults": [FAULTS.parse(f) for f in faults], "speed": speed, **(controller or {})}
        bench = Bench(heard := Listening(simulated, **options), Gcs2Server(heard))
        made.append(bench)
        bench.server.__enter__()
        if opened:
            bench.stage = Gcs2Stage(bench.setup(**changes))
        return bench

    yield make
    for bench in made:
        if bench.stage is not None:
            bench.stage._axis.client.connection.close()
        bench.server.close()


@pytest.fixture
def play():
    """Upload, arm, start, wait, read."""

    def run(stage, voltage):
        stage.upload(voltage)
        stage.arm()
        stage.start()
        stage.wait(5.0)
        return stage.read()

    return run
