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

"""Through a controller or a card a stage is identified, and its missing effect found, as if it were played directly."""

import math
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest

from piezo_hysteresis.discrepancy import Verdict
from piezo_hysteresis.emulators.gcs2.controller import Controller
from piezo_hysteresis.emulators.gcs2.server import Gcs2Server
from piezo_hysteresis.stage.gcs2.setup import Gcs2Setup
from piezo_hysteresis.stage.gcs2.stage import Gcs2Stage
from piezo_hysteresis.stage.simulated import SimulatedStage

from .same_stage import (
    CREEPING,
    NOISE,
    PERIOD,
    PLAIN,
    SIGMAS,
    departure,
    diagnosed,
    direct,
    gap_found,
    identified,
    recorded,
    reference,
)

SEED = 1
GAIN = 20.0
"""Of the simulated amplifier."""


@contextmanager
def gcs2(plant):
    """Upload, arm, start, wait, read: block by block as long as the recorder, over TCP."""
    simulated = SimulatedStage(plant, seed=SEED, sample_period=PERIOD)
    with Gcs2Server(Controller(simulated, speed=math.inf, recorder_points=8 * 3000)) as server:
        setup = Gcs2Setup(
            server.host,
            server.port,
            amplifier_gain=GAIN,
            points_per_command=500,
            max_slew_rate=1e6,
            timeout=60.0,  # a busy machine, and not the network, decides
        )
        stage = Gcs2Stage(setup)
        longest = stage.description.longest_block

        def block(drive):
            stage.upload(drive)
            stage.arm()
            stage.start()
            stage.wait(5.0)
            return stage.read()

        def play(drives):
            assert max(drive.size for drive in drives) > 2 * longest, "phases are chained from blocks"
            cut = [np.split(drive, range(longest, drive.size, longest)) for drive in drives]
            return [joined([block(part) for part in parts]) for parts in cut]

        yield play
        stage.close()


@contextmanager
def nidaqmx(plant):
    """One stream of blocks from the first phase to the last, over gRPC."""
    pytest.importorskip("nidaqmx", reason="nidaqmx is not installed: pip install 'nidaqmx[grpc]'")
    pytest.importorskip("grpc")
    from piezo_hysteresis.emulators.daqmx.card import Card
    from piezo_hysteresis.emulators.daqmx.server import DaqmxServer
    from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
    from piezo_hysteresis.stage.daqmx.stage import DaqmxStage

    with DaqmxServer(Card(SimulatedStage(plant, seed=SEED, sample_period=PERIOD), speed=math.inf)) as server:
        wiring = {"voltage_input": "ai1", "amplifier_gain": GAIN, "server": f"127.0.0.1:{server.port}"}
        stage = DaqmxStage(DaqmxSetup("Dev1", max_slew_rate=1e6, sample_period=PERIOD, **wiring))
        late = round(stage.description.latency / PERIOD)

        def play(drives):
            drive = np.concatenate((*drives, np.zeros(late)))
            got = joined([stage.exchange(part) for part in np.split(drive, range(500, drive.size, 500))])
            ends = np.cumsum([drive.size for drive in drives])[:-1]
            return list(zip(*(np.split(channel[late:], ends) for channel in got), strict=True))

        yield play
        stage.close()


def joined(parts):
    return tuple(np.concatenate([getattr(part, name) for part in parts]) for name in ("voltage", "displacement"))


@cache
def through(back_end, plant):
    """The protocol played on a plant through a back end."""
    with back_end(plant) as play:
        return recorded(play)


both = pytest.mark.parametrize("back_end", [gcs2, nidaqmx], ids=lambda opened: opened.__name__)


@both
def test_the_model_is_that_of_the_simulated_stage_within_the_noise(back_end):
    experiment = through(back_end, PLAIN)
    for one, other in zip(experiment, direct(PLAIN, SEED), strict=True):
        np.testing.assert_allclose(one.voltage, other.voltage, atol=1e-6)
        assert np.std(one.displacement - other.displacement) < 1.05 * math.sqrt(2) * NOISE
    found, expected = identified(experiment), reference(PLAIN, SEED)
    assert found.delay.samples == expected.delay.samples
    apart = departure(found, expected)
    assert max(apart.parameters.values()) < SIGMAS, apart.parameters
    assert apart.response.max() < SIGMAS
    assert max(apart.free_run.values()) < SIGMAS, apart.free_run
    assert found.free_run_error < 1.2 * NOISE


@both
def test_the_missing_effect_is_that_of_the_simulated_stage_within_the_noise(back_end):
    found, expected = gap_found(through(back_end, CREEPING)), diagnosed(CREEPING, SEED)
    assert (found.verdict, found.names) == (expected.verdict, expected.names) == (Verdict.NAMED, ("creep",))
    value, error = (
        np.array([f.fit.values["creep.gamma"], f.fit.standard_errors["creep.gamma"]]) for f in (found, expected)
    )
    assert abs(value[0] - error[0]) < SIGMAS * np.hypot(value[1], error[1])
    assert found.gap.after == pytest.approx(expected.gap.after, rel=0.05)
    assert found.gap.before == pytest.approx(expected.gap.before, rel=0.05)
    plain = gap_found(through(back_end, PLAIN))
    assert plain.verdict is Verdict.NOTHING_MISSING


@both
@pytest.mark.soak
def test_out_of_the_whole_catalogue_the_same_effect_is_named(back_end):
    found, expected = gap_found(through(back_end, CREEPING), whole=True), diagnosed(CREEPING, SEED, whole=True)
    assert found.names == expected.names == ("creep",)
