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

"""A driver's session on every back end, and the real output of the device, sample by sample."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from piezo_hysteresis.acquisition.session import DriverSession
from piezo_hysteresis.acquisition.settings import DRIVER, DriverSettings
from piezo_hysteresis.emulators.gcs2.controller import Controller
from piezo_hysteresis.emulators.gcs2.server import Gcs2Server
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.back_ends import BACK_ENDS
from piezo_hysteresis.stage.gcs2.connection import Connection
from piezo_hysteresis.stage.simulated import SimulatedMemoryStage, SimulatedStage

PERIOD = 1e-4
SLEW, RAMP = 1000.0, 50.0
"""Of the driver [V/s]: steepest waveform, and rate of every way that the stage goes by itself."""
LSB = 20.0 / 2**16
"""Of the converter: what is put out is rounded [V]."""
GAIN = 20.0
TOP = 6.0
SAFE_WITHIN = 2e-3
"""Noise and rounding of a voltage that is at the safe one [V]."""


class WireStage(SimulatedStage):
    """The amplifier at the end of the wire of an emulated device: it keeps every sample that it is given."""

    def __init__(self, **options) -> None:
        super().__init__(sample_period=PERIOD, **options)
        self.parts: list[np.ndarray] = []
        run = self._plant.run

        def kept(voltage):
            self.parts.append(np.array(voltage))
            return run(voltage)

        self._plant.run = kept
        self.observe = lambda: None

    @property
    def output(self) -> float:
        """Voltage put out now [V]."""
        self.observe()
        return float(self.parts[-1][-1]) if self.parts else 0.0

    @property
    def wire(self) -> np.ndarray:
        """All samples so far [V]."""
        return np.concatenate([np.zeros(1), *list(self.parts)])


def values(word: str, **changes) -> dict:
    """Values of the parameters of a back end."""
    return {row.name: row.value for row in BACK_ENDS[word].rows} | changes


def settings(word: str, **changes) -> DriverSettings:
    """Settings of a driver with the limits of this file."""
    defaults = {row.name: row.value for row in DRIVER}
    limits = {"max_slew_rate": SLEW, "ramp_rate": RAMP, "sample_period": PERIOD, "keeper_timeout": 0.0}
    return DriverSettings.from_values(defaults | limits | {"stage": word} | changes)


class WiredSession:
    """A session, the amplifier at the end of its wire, and what the session says."""

    def __init__(self, word: str, parameters: dict, amplifier: WireStage | None = None, **changes) -> None:
        self.session = DriverSession(settings(word, **changes), parameters, f"test {word} {time.monotonic_ns()}")
        if amplifier is None:  # the simulated stage is the amplifier itself
            simulated: Any = self.session.stage
            simulated.parts = []
            run = simulated._plant.run
            simulated._plant.run = lambda voltage: (simulated.parts.append(np.array(voltage)), run(voltage))[1]
        self.amplifier: Any = simulated if amplifier is None else amplifier
        self.deliveries, self.failures = [], []
        self.acquisition: Any = None
        _SESSIONS.append(self)

    def start(self) -> None:
        self.acquisition = self.session.start(
            node_clock=time.time_ns,
            deliver=self.deliveries.append,
            fail=self.failures.append,
            subscribers=lambda: 1,
        )

    @property
    def wire(self) -> np.ndarray:
        return np.concatenate([np.zeros(1), *list(self.amplifier.parts)])

    @property
    def output(self) -> float:
        """Voltage put out now [V]."""
        if isinstance(self.amplifier, WireStage):
            return self.amplifier.output
        parts = self.amplifier.parts
        return float(parts[-1][-1]) if parts else 0.0

    def play(self, waveform, name="wave") -> None:
        wave = self.session.check.waveform(np.asarray(waveform, dtype=float), 0, 0)
        self.acquisition.play(wave, name, 0, self.session.check.first_step, lambda phase, size: None)

    def wait(self, condition, what: str, timeout: float = 30.0) -> None:
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f"waited {timeout:g} s for {what}; failures: {[str(f) for f in self.failures]}")
            time.sleep(1e-3)

    def rises(self) -> None:
        """Play a slow rise to the top and wait until the wire is on its way."""
        self.play(np.concatenate((np.linspace(0.0, TOP, 6000), np.full(20_000, TOP))))
        stage = self.session.stage
        if isinstance(stage, SimulatedMemoryStage):  # its plant learns what was played when that ends
            self.wait(lambda: stage._playing, "motion")
            time.sleep(0.3)
        else:
            self.wait(lambda: self.output > 2.0, "motion")

    def end(self) -> None:
        if self.acquisition is not None:
            self.acquisition._halting.set()
            self.acquisition._thread.join(10.0)
        with suppress(StageError):
            self.session.close()


_SESSIONS: list[WiredSession] = []
"""Sessions with the present device."""


@contextmanager
def device(word: str, **options) -> Iterator[tuple[str, dict, WireStage | None, object]]:
    """Word of the back end, values of its parameters, the amplifier, and the emulated device.

    An error ends the sessions with it: their files and threads would fail the next test, or a second try.
    """
    _SESSIONS.clear()
    with _device(word, **options) as found:
        try:
            yield found
        except BaseException:
            for session in _SESSIONS:
                session.end()
            raise


@contextmanager
def _device(word: str, **options) -> Iterator[tuple[str, dict, WireStage | None, object]]:
    if word == "gcs2":
        amplifier = WireStage(seed=3)
        controller = Controller(amplifier, **{"serial": f"{time.monotonic_ns()}"} | options)  # a device of its own
        with Gcs2Server(controller) as server, closing(Connection(server.host, server.port, 5.0)) as observer:

            def observe():  # it lives on when it is asked; its error is left to the driver
                with suppress(StageError):
                    observer.send("VOL? 1\n")
                    observer.receive()

            amplifier.observe = observe
            address = {"host": server.host, "port": server.port, "amplifier_gain": GAIN, "points_per_command": 100}
            yield word, values(word, max_slew_rate=1e6, **address), amplifier, (controller, server)
    elif word == "nidaqmx":
        from piezo_hysteresis.emulators.daqmx.card import Card
        from piezo_hysteresis.emulators.daqmx.server import DaqmxServer

        amplifier = WireStage(seed=3)
        card = Card(amplifier, **options)
        with DaqmxServer(card) as server:
            wiring = {"device": "Dev1", "server": f"127.0.0.1:{server.port}", "voltage_input": "ai1", "lead": 0.5}
            yield word, values(word, max_slew_rate=1e6, **wiring), amplifier, (card, server)
    else:
        memory = word == "memory"
        yield "simulated", values("simulated", memory=memory, longest_block=50_000, dead_time=0.0), None, None


def leave_at(word: str, emulated: Any, voltage: float) -> None:
    """Leave the output of an emulated device at a voltage [V], as a program that has ended does."""
    if word == "gcs2":
        emulated.carry_out(f"SVA 1 {voltage * GAIN}")
    else:
        emulated.set(voltage)


def driver_process(folder: Path, word: str, parameters: dict, timeout: float) -> subprocess.Popen:
    """A driver without ROS in a process of its own, `piezo record`; what it says is in ``folder/log``."""
    ours = {"stage": word, "sample_period": PERIOD, "max_slew_rate": SLEW, "ramp_rate": RAMP, "voltage_max": TOP}
    file = folder / "stage.yaml"
    given = ours | {"keeper_timeout": timeout, word: parameters}
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": given}}))
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "record", str(file), "short", "-o", str(folder / "e")]
    with (folder / "log").open("wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=log)


def check_wire(wire: np.ndarray, *, begins: float = 0.0) -> None:
    """Every sample inside the range, no step above the slew, and none on the way down above the ramp rate."""
    steps = np.diff(wire)
    assert wire.min() >= -LSB
    assert wire.max() <= max(TOP, begins) + LSB
    assert steps.max() <= SLEW * PERIOD + 2 * LSB
    assert steps.min() >= -RAMP * PERIOD - 2 * LSB, f"a fall of {-steps.min():g} V in one sample"
