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

"""What a running driver does with commands: all of it, or nothing and a reason; one driver for all tests here."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.messages.conversions import command_to_cloud

pytestmark = pytest.mark.nodes

PERIOD = 2e-5
RAMP_RATE = 20.0


@pytest.fixture(scope="module")
def streaming_lab(shared_lab):
    """A driver without a converter: the voltages published are those applied, bit for bit."""
    shared_lab.driver(simulated__electronics__dac_bits=0.0, ramp_rate=RAMP_RATE, max_slew_rate=4e5)
    return shared_lab


@pytest.fixture
def driven(streaming_lab):
    """The driver at rest at its safe voltage."""
    yield streaming_lab
    streaming_lab.forget()
    samples = streaming_lab.streaming()
    streaming_lab.call(Trigger, "driver_node/cancel")
    streaming_lab.call(Trigger, "driver_node/release")
    streaming_lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    streaming_lab.forget()


def test_every_sample_of_a_command_arrives_or_is_reported_lost(driven):
    samples, statuses, phases = driven.streaming(), driven.statuses(), driven.phases()
    seconds = 8.0  # eight times what the queue of `samples` keeps; make soak plays for minutes
    wave = np.concatenate(([0.0], np.random.default_rng(1).uniform(0, 7, round(seconds / PERIOD)), [0.0]))
    driven.send(wave, "noise")
    done = ["accepted", "playing", "done"]
    driven.wait(lambda: driven.states(statuses, "noise") == done, "the end of the command", 90.0 + seconds)
    number, first = (driven.value(statuses, "noise", "done", key) for key in ("phase", "first_index"))
    driven.wait(lambda: samples.newest.index[-1] > first + wave.size, "the samples after it")
    assert (np.diff(samples.place()) > 0).all()
    assert samples.played(wave, first, number)
    assert [p.data.partition(" ")[2] for p in phases][-2:] == ["noise", "hold"]


@pytest.mark.parametrize(("frame_id", "name"), [("triangle", "triangle"), ("stage", "command"), ("", "command")])
def test_a_phase_that_no_field_names_is_read_from_frame_id(driven, frame_id, name):
    statuses, sender = driven.statuses(), driven.publisher(PointCloud2, "command")
    cloud = command_to_cloud(np.linspace(0.0, 0.1, 100), PERIOD, "")
    cloud.fields, cloud.header.frame_id = cloud.fields[:-1], frame_id  # the frame of this driver is 'stage'
    sender.publish(cloud)
    driven.wait(lambda: driven.states(statuses, name)[-1:] == ["done"], "the end of the command")


def test_stamps_and_times_are_one_clock(driven):
    samples = driven.streaming()
    driven.wait(lambda: len(samples.blocks) > 100, "a second of blocks")
    blocks = samples.blocks[:100]
    start = np.array([b.stamp + round(b.time[0] * 1e9) for b in blocks])
    expected = np.array([int(b.index[0]) for b in blocks]) * round(PERIOD * 1e9)
    assert np.abs((start - start[0]) - (expected - expected[0])).max() <= 1
    assert all(b.sample_period == pytest.approx(PERIOD, rel=1e-9) for b in blocks)


def test_a_refused_command_plays_nothing(driven):
    samples, statuses = driven.streaming(), driven.statuses()
    refused = {
        "too_high": ([0.0, 1.0, 10.1], PERIOD, 0.0, "expected 0 to 10 V"),
        "too_low": ([0.0, -0.1], PERIOD, 0.0, "expected 0 to 10 V"),
        "too_steep": ([0.0, 9.0, 0.0], PERIOD, 0.0, "V/s"),
        "far_start": ([9.0, 9.0], PERIOD, 0.0, "V/s"),
        "not_finite": ([0.0, np.nan, 0.0], PERIOD, 0.0, "finite"),
        "other_period": ([0.0, 0.1, 0.0], 2 * PERIOD, 0.0, "period"),
        "old": ([0.0, 0.1, 0.0], PERIOD, 3.0, "old"),
        "empty": ([], PERIOD, 0.0, "no points"),
    }
    for name, (wave, period, age, _) in refused.items():
        driven.send(wave, name, period, age=age)
    driven.wait(lambda: {s.name for s in statuses} >= set(refused), "all refusals")
    reasons = {s.name: s.message for s in statuses}
    for name, (_, _, _, reason) in refused.items():
        assert driven.states(statuses, name) == ["refused"]
        assert reason in reasons[name], reasons[name]
    blocks = len(samples.blocks)
    driven.wait(lambda: len(samples.blocks) > blocks + 10, "later blocks")
    assert not samples.voltage.any()
    assert (samples.phase == samples.phase[0]).all()


def test_a_second_command_is_refused_and_the_first_played_whole(driven):
    samples, statuses = driven.streaming(), driven.statuses()
    wave = np.linspace(0, 2, 20_000)
    driven.send(wave, "first")
    driven.send(np.zeros(10), "second")
    driven.wait(lambda: "done" in driven.states(statuses, "first"), "the first command")
    assert driven.states(statuses, "second") == ["refused"]
    number, first = (driven.value(statuses, "first", "done", key) for key in ("phase", "first_index"))
    driven.wait(lambda: samples.newest.phase[-1] == number + 1, "the hold after it")
    assert samples.played(wave, first, number)


def test_set_voltage_ramps_to_a_level_and_stays_there(driven):
    samples, statuses, live = driven.streaming(), driven.statuses(), driven.listen(JointState, "live")
    ask = driven.publisher(Float64, "set_voltage")
    ask.publish(Float64(data=4.0))
    driven.wait(lambda: samples.newest.voltage[-1] == 4.0, "the set-point")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    for wrong in (10.5, -0.5, float("nan")):
        ask.publish(Float64(data=wrong))
    driven.wait(lambda: driven.states(statuses, "set_voltage") == ["refused"] * 3, "three refusals")
    assert samples.voltage.max() == 4.0
    driven.wait(lambda: live and live[-1].position[0] == 4.0, "live values")
    assert list(live[-1].name) == ["voltage", "displacement"]


def test_stop_ramps_a_playing_waveform_down(driven):
    samples, statuses = driven.streaming(), driven.statuses()
    driven.send(np.concatenate((np.linspace(0, 3, 10_000), np.full(500_000, 3.0))), "long")
    driven.wait(lambda: samples.newest.voltage[-1] == 3.0, "the top")
    assert driven.call(Trigger, "driver_node/stop").success
    driven.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert driven.states(statuses, "long") == ["accepted", "playing", "stopped"]
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    reported = driven.diagnostics()
    ask = driven.publisher(Float64, "set_voltage")
    driven.send(np.zeros(10), "too_early")
    ask.publish(Float64(data=1.0))
    for name in ("too_early", "set_voltage"):
        driven.wait(
            lambda name=name: any(s.name == name and "call ~/release" in s.message for s in list(statuses)),
            f"the refusal of {name}",
        )
    driven.wait(
        lambda: any("until ~/release" in s.message for a in list(reported) for s in a.status), "the diagnostics"
    )
    assert not samples.voltage[-10:].any()
    assert driven.call(Trigger, "driver_node/release").message == "the driver accepts commands again"
    driven.send(np.zeros(10), "next")
    driven.wait(lambda: "done" in driven.states(statuses, "next"), "a later command")


def test_a_cancelled_waveform_ends_safe_and_the_next_one_is_taken(driven):
    samples, statuses = driven.streaming(), driven.statuses()
    driven.send(np.concatenate((np.linspace(0, 3, 10_000), np.full(500_000, 3.0))), "long")
    driven.wait(lambda: samples.newest.voltage[-1] == 3.0, "the top")
    assert driven.call(Trigger, "driver_node/cancel").success
    driven.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    driven.send(np.zeros(10), "next")
    driven.wait(lambda: "done" in driven.states(statuses, "next"), "a later command")
