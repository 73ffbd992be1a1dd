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

"""The driver under fire: its stage is never asked for a voltage outside the limits or too steep, sample by sample.

Its stage is the test's own and notes what it is given; every test ends with a look into that log.
"""

import itertools
import signal
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from benchmarks.stage_log import StageLog
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
LIMITS = {"voltage_min": 0.0, "voltage_max": 8.0, "max_slew_rate": 1000.0, "ramp_rate": 40.0}
WAVE = 3.5 - 3.5 * np.cos(2 * np.pi * 10 * PERIOD * np.arange(10_000))


class Bench:
    """A driver with the test's own stage; it can be killed and started again."""

    def __init__(self, lab):
        self.lab, self.log = lab, StageLog(lab.folder / "voltages", PERIOD, **LIMITS)
        self.start()

    def start(self, **parameters):
        """A new driver, and its samples."""
        named = {"sample_period": PERIOD, **LIMITS, **parameters}
        self.driver = self.lab.driver(program=self.log.driver, environment=self.log.environment, **named)
        self.samples = self.lab.streaming()

    def reaches(self, voltage):
        self.lab.wait(lambda: self.samples.newest.voltage[-1] >= voltage, f"{voltage:g} V")

    def play(self, wave, name):
        """Send a command until the driver plays it: one that was killed is known, and sent to, for a while."""
        statuses = self.lab.statuses()
        sent = itertools.count(1)

        def plays():
            if next(sent) % 10 == 0:
                self.lab.renew_command()
            self.lab.send(wave, name, PERIOD, age=None)
            self.lab.pause(0.5)
            return "playing" in self.lab.states(statuses, name)

        self.lab.wait(plays, f"{name} to be played")
        return statuses


@pytest.fixture
def bench(lab):
    """A driver and a node of the test's own; the log of the stage is looked at when the test is over.

    What a killed driver leaves in the node that spoke to it must not reach the next test, nor a second try.
    """
    bench = Bench(lab)
    yield bench
    bench.log.check()


@pytest.mark.parametrize("when", [pytest.param("idle", marks=pytest.mark.soak), "waveform", "hold", "way_to_safety"])
def test_a_driver_killed_in_any_phase_starts_again_at_once(bench, when):
    lab, starts = bench.lab, bench.log.starts
    if when != "idle":
        bench.play(np.concatenate((WAVE[:400], np.full(20_000 if when == "waveform" else 1, WAVE[400]))), when)
        bench.reaches(3.4)
    if when == "hold":
        lab.wait(lambda: (bench.samples.newest.voltage > 3.4).all(), "the hold")
    elif when == "way_to_safety":
        client = lab.node.create_client(Trigger, "driver_node/stop")
        lab.wait(client.service_is_ready, "the service")
        begin = len(bench.samples.blocks)  # the way takes a sixth of a second, in which a busy test may not look
        client.call_async(Trigger.Request())
        lab.wait(lambda: any(0 < b.voltage[-1] < 3.3 for b in bench.samples.blocks[begin:]), "the way down")
    bench.driver.signal(signal.SIGKILL)
    bench.driver.wait()
    lab.forget()
    bench.start()
    assert bench.samples.voltage[0] == pytest.approx(0.0, abs=1e-3)
    assert bench.log.starts == starts + 1


def test_a_stalled_driver_takes_up_where_it_was(bench):
    """Stopped for two seconds in mid-waveform: no sample is left out, and the stamps show the pause."""
    lab, samples, driver = bench.lab, bench.samples, bench.driver
    reports = lab.diagnostics()
    statuses = bench.play(np.tile(WAVE, 3), "stalled")
    driver.signal(signal.SIGSTOP)
    lab.pause(2.0)
    driver.signal(signal.SIGCONT)
    lab.wait(lambda: "done" in lab.states(statuses, "stalled"), "the end of the wave")
    first = lab.value(statuses, "stalled", "done", "first_index")
    lab.wait(lambda: samples.newest.index[-1] >= first + 3 * WAVE.size, "its samples")
    so_far = samples.so_far()
    assert so_far.lost == 0
    inside = (so_far.place() >= first) & (so_far.place() < first + 3 * WAVE.size)
    np.testing.assert_allclose(so_far.voltage[inside], np.tile(WAVE, 3), atol=2e-4)
    steps = np.diff([b.stamp for b in so_far.blocks]) * 1e-9 - 0.01
    assert steps.max() > 1.0
    assert (steps > -1e-3).all()
    lab.wait(lambda: any("behind" in s.message for r in list(reports) for s in r.status), "the pause on /diagnostics")


def test_floods_of_everything_at_once(bench):
    """Commands good and bad, set-points, parameters, two hundred foreign topics, while a waveform plays."""
    lab, samples, driver = bench.lab, bench.samples, bench.driver
    foreign = [lab.node.create_publisher(String, f"/foreign_{k}/samples", 10) for k in range(200)]
    command, ask = lab.publisher(PointCloud2, "command"), lab.publisher(Float64, "set_voltage")
    wave = np.tile(WAVE, 3)
    statuses = bench.play(wave, "wave")
    chance = np.random.default_rng(1)
    client = lab.node.create_client(SetParameters, "driver_node/set_parameters")
    lab.wait(client.service_is_ready, "the parameter service")
    asked = []
    for k in range(300):
        name = chance.choice(["voltage_max", "ramp_rate", "sample_period", "in_force.voltage_max", "nonsense", "stage"])
        value = [float(chance.uniform(-1e5, 1e5)), float("nan"), "word", True, 7, [1.0, float("inf")]][k % 6]
        request = SetParameters.Request(parameters=[Parameter(str(name), value=value).to_parameter_msg()])
        asked.append(client.call_async(request))
        ask.publish(Float64(data=float(chance.choice([np.nan, np.inf, -1e300, 1e300, 12.0, 5.0]))))
        noise = chance.uniform(-1, 9, int(chance.integers(1, 500)))
        noise[chance.integers(noise.size)] = chance.choice([np.nan, np.inf, 0.0, 1e308])
        cloud = command_to_cloud(noise, PERIOD, f"flood_{k}", lab.node.get_clock().now().to_msg())
        if k % 5 == 0:
            cloud.header.stamp.nanosec = 2**32 - 1
        elif k % 5 == 1:
            cloud.header.frame_id = "x" * 100_000
        command.publish(cloud)
        foreign[k % 200].publish(String(data="x" * 1000))
    last = SetParameters.Request(parameters=[Parameter("ramp_rate", value=1.0).to_parameter_msg()])
    assert not lab.call(SetParameters, "driver_node/set_parameters", last).results[0].successful
    answered = [future.result() for future in asked if future.done()]  # a service takes ten requests at a time
    assert len(answered) > 10
    assert not any(result.successful for answer in answered for result in answer.results)
    # refusals without number have pushed the end of the command out of its topic: the samples show it
    first, number = (lab.value(statuses, "wave", "playing", key) for key in ("first_index", "phase"))
    lab.wait(lambda: samples.newest.phase[-1] > number, "the end of the wave")
    so_far = samples.so_far()
    inside = so_far.phase == number
    np.testing.assert_allclose(so_far.voltage[inside], wave[so_far.place()[inside] - first], atol=2e-4)
    assert inside.sum() + so_far.lost >= wave.size
    assert driver.is_running
    lab.do(lambda: [lab.node.destroy_publisher(publisher) for publisher in foreign])
    assert len(driver.output) < 200_000


def test_a_slow_subscriber_and_a_paused_model_node_do_not_affect_others(bench):
    """Four seconds: a subscriber of depth 10 that sleeps, and a model node that is stopped and goes on."""
    lab, samples = bench.lab, bench.samples
    model = lab.start("model_node")
    reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
    lab.wait(lambda: any(s.name.startswith("model_node") for r in list(reports) for s in r.status), "the model node")
    slow = lab.second_node("slow")
    heard = []

    def sleepy(cloud):
        heard.append(cloud)
        lab.pause(0.2)

    quality = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
    slow.create_subscription(PointCloud2, "samples", sleepy, quality)
    lab.wait(lambda: len(heard) > 2, "the slow subscriber")

    def unaccounted():
        """Samples that the model node has neither received nor reported lost, except in the second since its report."""
        reported = [values_of(s) for r in list(reports) for s in r.status if s.name.startswith("model_node")]
        counted = [int(values["received"]) + int(values["lost"]) for values in reported if "received" in values]
        return int(samples.newest.index[-1]) - counted[-1] if counted else None

    lab.wait(lambda: unaccounted() is not None, "figures of the model node")
    before = unaccounted()
    model.signal(signal.SIGSTOP)
    begin = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > begin + 350, "three and a half seconds of blocks")
    model.signal(signal.SIGCONT)
    assert samples.so_far().lost == 0
    lab.wait(lambda: unaccounted() < before + 1.5 / PERIOD, "every sample received or reported lost by the model node")


def test_the_clock_of_the_system_jumps(bench):
    """An hour ahead and two hours back: samples go on, stamps follow, and it is reported."""
    lab, samples = bench.lab, bench.samples
    reports = lab.diagnostics()
    statuses = bench.play(np.tile(WAVE, 3), "wave")
    now = 0
    for jump in (3600, -7200):
        now += jump
        bench.log.shift_clock(now)
        lab.wait(
            lambda now=now: abs(samples.newest.stamp * 1e-9 - time.time() - now) < 1.0,
            f"stamps after a jump of {jump} s",
        )
    bench.log.shift_clock(0)
    lab.wait(lambda: "done" in lab.states(statuses, "wave"), "the end of the wave")
    first = lab.value(statuses, "wave", "done", "first_index")
    lab.wait(lambda: samples.newest.index[-1] >= first + 3 * WAVE.size, "its samples")
    assert samples.so_far().lost == 0

    def reported():
        return [float(values_of(s).get("clock_jumps", 0)) for r in list(reports) for s in r.status]

    lab.wait(lambda: max(reported(), default=0.0) > 10_000, "the jumps on /diagnostics")
