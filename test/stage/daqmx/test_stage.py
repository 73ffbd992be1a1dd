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

"""The NI-DAQmx back end keeps the promises of the stage protocol over real gRPC, with NI's own client in between."""

import math
import sys
import threading
import time

import numpy as np
import pytest

from piezo_hysteresis.acquisition.drive import EventKind
from piezo_hysteresis.acquisition.playback import Playback
from piezo_hysteresis.acquisition.streaming import StreamingAcquisition
from piezo_hysteresis.acquisition.time_base import TimeBase
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.daqmx.loop_back import loop_back_delay
from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
from piezo_hysteresis.stage.daqmx.stage import DaqmxStage
from piezo_hysteresis.stage.simulated import SimulatedStage
from piezo_hysteresis.stage.stage import Stage, StreamingStage

TS = 20e-6
WAVE = 2.0 - 2.0 * np.cos(2 * np.pi * np.arange(4000) / 2000)
LEAD = 500


@pytest.fixture
def opened(rig):
    """The emulated card and the back end on it."""

    def make(*faults, **options):
        made = rig(*faults, **options)
        return made.card, made.stage

    return make


def test_it_is_a_streaming_stage_with_a_latency(opened):
    card, stage = opened()
    promised = {name for part in (Stage, StreamingStage) for name in vars(part) if not name.startswith("_")}
    assert promised <= set(dir(stage))
    assert stage.description.streaming and stage.description.measured_voltage
    assert stage.description.latency == LEAD * TS
    assert card.voltage == stage.voltage == 0.0, "opening moves nothing"
    stage.close()


@pytest.mark.parametrize("monitor", ["ai1", ""])
def test_a_stream_gives_the_result_of_the_simulated_stage(opened, ideal, monitor, streamed):
    _, stage = opened(plant=ideal(), voltage_input=monitor)
    voltage, displacement = streamed(stage, WAVE, 1, 700, 2000, 2001)
    expected = SimulatedStage(ideal(), sample_period=TS).play(np.r_[np.zeros(LEAD), WAVE], initial_voltage=0.0)
    np.testing.assert_allclose(voltage, expected.voltage[: WAVE.size], atol=1e-12)
    np.testing.assert_allclose(displacement, expected.displacement[: WAVE.size], rtol=1e-9, atol=1e-15)
    stage.close()


def test_a_stream_ends_safe_and_nothing_in_the_buffer_is_lost(opened):
    card, stage = opened(max_slew_rate=2000.0)
    stage.exchange(np.linspace(0.0, 4.0, 200))
    assert card.voltage == 4.0 or card.voltage == pytest.approx(4.0, abs=2e-4)
    stage.safe()
    assert card.voltage == stage.voltage == 0.0
    stage.exchange(np.full(10, 0.01))
    stage.close()
    assert card.voltage == 0.0
    with pytest.raises(StageError, match="closed"):
        stage.exchange(np.zeros(1))


def test_slow_path_sets_and_reads(opened, ideal):
    _, stage = opened(plant=ideal())
    stage.exchange(np.full(100, 1.0))
    stage.set_voltage(4.0)
    simulated = SimulatedStage(ideal(), sample_period=TS)
    simulated.play(np.r_[np.zeros(LEAD), np.full(100 + LEAD, 1.0)], initial_voltage=0.0)
    simulated.set_voltage(4.0)
    for _ in range(4):
        assert stage.read_displacement() == pytest.approx(simulated.read_displacement(), rel=1e-6)
    stage.close()


def test_a_drive_outside_a_limit_is_not_played(opened):
    card, stage = opened()
    for drive in ([10.1], [-0.1], [math.nan], []):
        with pytest.raises(StageError, match="expected"):
            stage.exchange(np.array(drive))
    assert card.voltage == 0.0
    stage.close()


def test_a_block_that_comes_too_late_is_reported_and_ends_safe(opened):
    card, stage = opened(speed=1.0, lead=0.5)
    stage.exchange(np.full(100, 2.0))
    time.sleep(0.7)
    with pytest.raises(StageError, match=r"generation has stopped.*safe voltage, 0 V"):
        stage.exchange(np.full(100, 2.0))
    assert card.voltage == 0.0
    stage.close()


def test_the_delay_of_the_card_is_measured_apart_and_taken_off(opened, streamed):
    _, looped = opened(displacement_input="ai2", voltage_input="", sensor_gain=1.0)
    delay = loop_back_delay(looped)
    looped.close()
    assert delay == pytest.approx(2 * TS, abs=0.05 * TS)
    _, corrected = opened(displacement_input="ai2", voltage_input="", sensor_gain=1.0, io_delay=delay)
    voltage, echo = streamed(corrected, WAVE, 1000)
    np.testing.assert_allclose(echo, voltage, atol=2e-4)
    corrected.close()


@pytest.mark.parametrize(("lead", "io_delay"), [(LEAD, 0.0), (LEAD, 2.0), (0.3, 0.0), (0.3, 2.0)])
def test_a_label_lies_on_the_drive_of_its_phase(opened, lead, io_delay):
    """Whatever the delays, the samples of a phase are its waveform, all of it and nothing else."""
    _, stage = opened(
        displacement_input="ai2", voltage_input="", sensor_gain=1.0, lead=lead * TS, io_delay=io_delay * TS
    )
    deliveries, failures, done = [], [], threading.Event()

    def deliver(delivery):
        deliveries.append(delivery)
        if any(e.kind is EventKind.DONE for e in delivery.events):
            done.set()

    playback = Playback(0.0, 0.0, TS, 1e6)
    reports = {"node_clock": time.time_ns, "deliver": deliver, "fail": failures.append}
    acquisition = StreamingAcquisition(stage, playback, TimeBase(TS), 300, **reports)
    wave = WAVE + 1.0
    phase = acquisition.play(wave, "wave", 1, lambda wave, voltage: None, lambda phase, size: None)
    acquisition.start()
    assert done.wait(30.0), failures
    assert acquisition.make_safe(30.0)
    voltage, displacement, label, index = (
        np.concatenate([getattr(d.block, name) for d in deliveries])
        for name in ("voltage", "displacement", "phase", "index")
    )
    np.testing.assert_array_equal(voltage[label == phase.number], wave)
    if io_delay:
        np.testing.assert_allclose(displacement[label == phase.number], wave, atol=2e-4)
    told = {e.kind: d.first + e.offset for d in deliveries for e in d.events if e.phase == phase}
    where = index[label == phase.number]
    assert told == {EventKind.BEGAN: where[0], EventKind.DONE: where[-1] + 1}
    stage.close()


def test_the_latency_of_a_stage_is_that_of_its_sample_period(opened):
    _, stage = opened(lead=0.01, io_delay=41e-6)
    assert stage.description.latency == pytest.approx(502 * TS)
    stage.configure(0.1)
    assert stage.description.latency == pytest.approx(0.1), "the least buffer is one sample"
    stage.close()


def test_an_unconnected_input_has_no_delay(opened):
    _, stage = opened(displacement_input="ai0", voltage_input="", sensor_gain=1.0)
    with pytest.raises(StageError, match="expected"):
        loop_back_delay(stage)
    stage.close()


def test_without_the_package_the_error_states_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "nidaqmx", None)
    with pytest.raises(StageError, match=r"pip install 'nidaqmx\[grpc\]'"):
        DaqmxStage(DaqmxSetup("Dev1", max_slew_rate=1e3))


def test_setups_and_cards_that_cannot_be(opened):
    with pytest.raises(StageError, match="does not exist"):
        opened(displacement_input="ai9")
    for wrong in ({"device": ""}, {"lead": 0.0}, {"sensor_gain": 0.0}, {"io_delay": -1.0}, {"max_slew_rate": 0.0}):
        with pytest.raises(StageError, match="expected"):
            DaqmxSetup(**{"device": "Dev1", "max_slew_rate": 1e3, **wrong})
    with pytest.raises(StageError, match="safe_voltage"):
        opened(safe_voltage=8.0, voltage_max=5.0)
