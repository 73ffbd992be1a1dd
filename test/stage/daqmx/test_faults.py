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

"""Whatever fails: one clear error, the safe voltage where the link allows, and what is not known is said."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from piezo_hysteresis.emulators.daqmx.calls import Calls
from piezo_hysteresis.emulators.daqmx.card import Card, CardError
from piezo_hysteresis.emulators.daqmx.faults import FAULTS
from piezo_hysteresis.emulators.daqmx.server import DaqmxServer
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.daqmx.setup import DaqmxSetup
from piezo_hysteresis.stage.daqmx.stage import DaqmxStage
from piezo_hysteresis.stage.simulated import SimulatedStage

WAVE = 4.0 - 4.0 * np.cos(2 * np.pi * np.arange(4000) / 2000)
BLOCKS = range(400, 4000, 400)
STEPS = (
    "CreateTask:3 CreateAOVoltageChan:1 CreateAIVoltageChan:4 CfgSampClkTiming:1 CfgSampClkTiming:2 "
    "GetTimingAttributeDouble:1 SetWriteAttributeInt32:1 WriteAnalogF64:1 WriteAnalogF64:4 StartTask:1 StartTask:2 "
    "ReadAnalogF64:3 ReadAnalogF64:4 ReadAnalogF64:6 ClearTask:3 ClearTask:4"
)
"""Every kind of call between the first block and the last sample."""


def work(stage, streamed):
    record = streamed(stage, WAVE, *BLOCKS)
    stage.set_voltage(3.0)
    stage.read_displacement()
    return record


@pytest.mark.parametrize("step", STEPS.split())
def test_a_link_lost_at_any_step_ends_at_the_safe_voltage(rig, streamed, step):
    r = rig(f"link_lost@{step}", max_slew_rate=1e6)
    with pytest.raises(StageError, match=r"Failed to connect to server; .*safe voltage, 0 V"):
        work(r.stage, streamed)
    assert r.card.voltage == r.stage.voltage == 0.0
    work(r.stage, streamed)  # reconnected
    r.stage.close()


@pytest.mark.parametrize("step", ["CreateTask", "CreateAIVoltageChan", "ReadAnalogF64", "ClearTask"])
def test_a_link_lost_while_opening_is_reported_and_moves_nothing(rig, step):
    r = rig(f"link_lost@{step}", opened=False)
    r.card.set(4.0)
    with pytest.raises(StageError, match="Failed to connect to server"):
        DaqmxStage(r.setup())
    assert r.card.voltage == pytest.approx(4.0, abs=1e-3)
    DaqmxStage(r.setup()).close()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("slow=5", r"no answer within 0.8 s from 127.0.0.1:\d+"),
        ("slow@WriteAnalogF64:3=5", r"writing output failed: no answer within 0.8 s"),
        ("error", "Error Code: -50103|-50103"),
        ("error@StartTask=-200077", "starting output and input failed"),
        ("device_lost", "Device not available"),
        ("underflow", "generation has stopped"),
        ("late", "not yet been acquired"),
        ("short_read", r"got \d+ samples, expected 400"),
        ("garbled", r"sample \d+ of input \d is nan, expected finite numbers"),
        ("duplicated", "the same 400 samples twice"),
        ("wrong_clock", "samples every 4e-05 s, expected 2e-05 s"),
        ("saturated", r"measured a drive of 5\S* V at sample \d+, expected .* V .*saturated"),
        ("stale@StartTask", "displacement stayed at exactly"),
        ("swapped", "channels are exchanged"),
    ],
)
def test_every_failure_is_reported_clearly_and_ends_safe(rig, streamed, fault, message):
    r = rig(fault, timeout=0.8 if "slow" in fault else 5.0)
    with pytest.raises(StageError, match=rf"{message}.*safe voltage, 0 V") as raised:
        work(r.stage, streamed)
    assert "\n" not in str(raised.value)
    assert r.card.voltage == 0.0
    r.stage.close()


@pytest.mark.parametrize("step", ["StartTask:1", "ReadAnalogF64:4", "WriteAnalogF64:5"])
def test_a_lost_link_leaves_the_voltage_unknown_and_is_reported(rig, streamed, step):
    r = rig(f"gone@{step}")
    with pytest.raises(StageError, match=r"voltage of the stage is unknown, last commanded .* by hand: the card holds"):
        work(r.stage, streamed)
    with pytest.raises(StageError, match="unknown"):
        r.stage.close()
    r.stage.close()


def blind(rig, *faults, speed=math.inf):
    """A card that does not report its output, and every voltage that it puts out from now on."""
    r = rig(*faults, speed=speed, reads_back=False, voltage_input="", assume_safe=True, max_slew_rate=1000.0)
    exchange, wire = r.card._stage.exchange, [0.0]

    def kept(voltage):
        wire.extend(voltage)
        return exchange(voltage)

    r.card._stage.exchange = kept
    return r, wire


@pytest.mark.parametrize(
    "fault",
    [
        "underflow@WriteAnalogF64:4",
        "underflow@ReadAnalogF64:4",
        "late@ReadAnalogF64:4",
        "link_lost@ReadAnalogF64:4",
        "short_read@ReadAnalogF64:4",
        "duplicated@ReadAnalogF64:4",
    ],
)
def test_a_card_that_does_not_report_its_output_goes_down_from_the_last_voltage_it_was_given(rig, streamed, fault):
    r, wire = blind(rig, fault)
    with pytest.raises(StageError, match=r"safe voltage, 0 V"):
        streamed(r.stage, WAVE, *BLOCKS)
    assert max(wire) > 2.0
    assert wire[-1] == 0.0
    assert np.abs(np.diff(wire)).max() <= 1000.0 * r.stage.sample_period + 20.0 / 2**16, "one step of the converter"
    streamed(r.stage, WAVE, *BLOCKS)
    r.stage.close()


@pytest.mark.parametrize("call", ["WriteAnalogF64", "ReadAnalogF64"])
def test_an_output_runs_dry_only_after_all_that_was_written(rig, streamed, call):
    """The emulated card stopped with a full buffer: on the way down from what was written, its output jumped."""
    r, wire = blind(rig, f"underflow@{call}:4", speed=1.0)
    with pytest.raises(StageError, match=r"generation has stopped.*safe voltage, 0 V"):
        streamed(r.stage, WAVE, *BLOCKS)
    assert wire[-1] == 0.0
    assert np.abs(np.diff(wire)).max() <= 1000.0 * r.stage.sample_period + 20.0 / 2**16, "one step of the converter"


@pytest.mark.parametrize("fault", ["error@WriteAnalogF64:4", "link_lost@WriteAnalogF64:4"])
def test_a_card_that_does_not_report_its_output_is_not_moved_from_a_guess(rig, streamed, fault):
    """Nobody knows how much of a block that failed was put out."""
    r, wire = blind(rig, fault)
    with pytest.raises(StageError, match=r"voltage of the stage is unknown, last commanded .* by hand"):
        streamed(r.stage, WAVE, *BLOCKS)
    moved = len(wire)
    for use in (r.stage.safe, lambda: r.stage.set_voltage(0.0), lambda: r.stage.exchange(WAVE[:400]), r.stage.close):
        with pytest.raises(StageError, match="unknown"):
            use()
    assert set(wire[moved:]) <= {wire[moved - 1]}, "a reading of the inputs moves nothing"


def test_a_server_that_went_away_and_came_back_is_found_again(rig, streamed, ideal):
    r = rig(plant=ideal())
    streamed(r.stage, WAVE[:800], 400)
    port = r.server.port
    r.server.close()
    with pytest.raises(StageError, match="voltage of the stage is unknown"):
        r.stage.exchange(WAVE[800:1200])
    stands = r.card.voltage
    assert stands > 1.0, "the card holds its output"
    with DaqmxServer(r.card, port=port):
        r.stage.safe()
        assert r.card.voltage == r.stage.voltage == 0.0
        voltage, _ = streamed(r.stage, WAVE, *BLOCKS)
        np.testing.assert_allclose(voltage[500:], WAVE[:-500], atol=1e-9)
        r.stage.close()


def test_a_write_in_progress_leaves_nothing_behind_an_ended_server(ideal):
    card = Card(SimulatedStage(ideal()), speed=float("inf"))
    calls = Calls(card)
    task = SimpleNamespace(name=calls.CreateTask(None)["task"]["name"])
    calls.CreateAOVoltageChan(SimpleNamespace(task=task, physical_channel="Dev1/ao0"))
    calls.CfgSampClkTiming(SimpleNamespace(task=task, rate=1e4, samps_per_chan=10, sample_mode_raw=0))
    calls.end()
    with pytest.raises(CardError, match="server has ended"):
        calls.WriteAnalogF64(SimpleNamespace(task=task, write_array=[1.0] * 10, num_samps_per_chan=10))
    card.start(1e4, True)
    assert card.available == 0


def test_without_a_monitor_a_saturated_amplifier_cannot_be_seen(rig, streamed, ideal):
    r = rig("saturated", plant=ideal(), voltage_input="")
    voltage, displacement = streamed(r.stage, WAVE, *BLOCKS)
    assert voltage.max() == 8.0
    assert displacement.max() < SimulatedStage(ideal()).parameters.stroke(0.0, 6.0)
    r.stage.close()


def test_inputs_apart_by_one_sample_cannot_be_seen_and_are_a_delay(rig, streamed, ideal):
    straight, late = (streamed(rig(*faults, plant=ideal()).stage, WAVE, *BLOCKS)[1] for faults in ((), ("skewed",)))
    np.testing.assert_allclose(late[1:], straight[:-1], atol=1e-15)


def test_an_output_left_high_by_another_program_is_seen_where_there_is_a_monitor(rig):
    r = rig(opened=False)
    r.card.set(4.0)
    stage = DaqmxStage(r.setup(max_slew_rate=100.0))
    assert stage.voltage == pytest.approx(4.0, abs=1e-3)
    assert stage.read_voltage() == pytest.approx(4.0, abs=1e-3)
    with pytest.raises(StageError, match="steps by"):
        stage.exchange(np.zeros(10))
    stage.close()
    assert r.card.voltage == 0.0


def test_no_device_or_no_driver_on_this_machine():
    with pytest.raises(StageError, match=r"Failed to connect to server|no answer"):
        DaqmxStage(DaqmxSetup("Dev1", server="127.0.0.1:9", timeout=2.0, max_slew_rate=1e3))
    with pytest.raises(StageError, match=r"reading one sample failed: .*NI-DAQmx"):
        DaqmxStage(DaqmxSetup("Dev1", max_slew_rate=1e3))


def test_only_known_faults_can_be_injected():
    for kind in FAULTS.meaning:
        assert FAULTS.parse(kind).kind == kind
    with pytest.raises(StageError, match="expected one of"):
        Card(SimulatedStage(), faults=[FAULTS.parse("earthquake")])
