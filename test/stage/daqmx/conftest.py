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

"""An emulated card behind NI's gRPC interface on a real port, and the back end connected to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
pytest.importorskip("grpc")

from piezo_hysteresis.emulators.daqmx.card import Card
from piezo_hysteresis.emulators.daqmx.faults import FAULTS
from piezo_hysteresis.emulators.daqmx.server import DaqmxServer
from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
from piezo_hysteresis.stage.daqmx.stage import DaqmxStage
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 20e-6
LEAD = 500


@dataclass
class Rig:
    """A card, its server, and the back end."""

    card: Card
    server: DaqmxServer
    stage: DaqmxStage | None = None

    def setup(self, **changes) -> DaqmxSetup:
        wiring = {"voltage_input": "ai1", "lead": LEAD * PERIOD, "server": f"127.0.0.1:{self.server.port}"}
        wiring["max_slew_rate"] = 1e9
        return DaqmxSetup("Dev1", **wiring | changes)


@pytest.fixture
def rig():
    """Make rigs: emulated card with faults, back end opened with changes of the setup."""
    made = []

    def make(*faults: str, plant=None, seed=3, speed=math.inf, opened=True, reads_back=True, **changes) -> Rig:
        parsed = [FAULTS.parse(f) for f in faults]
        card = Card(SimulatedStage(plant, seed=seed), speed=speed, faults=parsed, reads_back=reads_back)
        rig = Rig(card, DaqmxServer(card))
        made.append(rig)
        rig.server.__enter__()
        if opened:
            rig.stage = DaqmxStage(rig.setup(**changes))
        return rig

    yield make
    for rig in made:
        rig.server.close()
        if rig.stage is not None:
            rig.stage._tasks.close()


@pytest.fixture
def streamed():
    """Exchange a drive in blocks; the voltage and the displacement that come back."""

    def run(stage, drive, *cuts):
        parts = [stage.exchange(block) for block in np.split(drive, cuts)]
        return tuple(np.concatenate([getattr(p, name) for p in parts]) for name in ("voltage", "displacement"))

    return run
