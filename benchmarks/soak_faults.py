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

"""The faults of the soak. Each one begins, lasts for a moment, and ends; the promises are checked elsewhere."""

from __future__ import annotations

import random
import signal
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from benchmarks.hostile_texts import hostile_texts
from benchmarks.mutated_commands import mutated
from benchmarks.soak_keeper import Keeper
from benchmarks.soak_processes import NAMESPACE, Soaked
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud
from piezo_hysteresis.nodes.runtime.qos import COMMAND, LATCHED

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


@dataclass
class Bench:
    """What a fault strikes at."""

    soaked: Soaked
    keeper: Keeper
    chance: random.Random
    models: tuple[str, str]
    """Two model files, both of the stage."""
    sample_period: float


def stall(name: str, longest: float) -> Callable[[Bench], None]:
    """SIGSTOP for a while."""

    def strike(bench: Bench) -> None:
        bench.soaked.send(name, signal.SIGSTOP)
        time.sleep(bench.chance.uniform(0.05, longest))
        bench.soaked.send(name, signal.SIGCONT)

    return strike


def kill_driver(bench: Bench) -> None:
    """SIGKILL; the next driver must start at once."""
    bench.soaked.kill("driver_node")
    bench.soaked.start("driver_node")


def kill_model(bench: Bench) -> None:
    """SIGKILL of the model node."""
    bench.soaked.kill("model_node")
    bench.keeper.is_good = False
    bench.soaked.start("model_node")


def kill_recorder(bench: Bench) -> None:
    """SIGKILL of the recorder; all that is older than a second must be in the bag."""
    bag, killed = bench.soaked.recording, time.monotonic()
    bench.soaked.kill("recorder")
    lost = bench.keeper.missing(bag, killed)
    if lost > 0:
        bench.keeper.break_promise(f"{lost} blocks recorded more than a second ago are not in {bag}")
    bench.soaked.forget(bag)
    bench.soaked.start("recorder")


def flood_of_commands(bench: Bench) -> None:
    """Waveforms and set-points without sense, a hundred of each."""
    command = bench.keeper.publisher(PointCloud2, "command", COMMAND)
    ask = bench.keeper.publisher(Float64, "set_voltage", COMMAND)
    noise = np.random.default_rng(bench.chance.getrandbits(32))
    for _ in range(100):
        wave = noise.uniform(-2, 12, 200)
        wave[noise.integers(200)] = noise.choice([np.nan, np.inf, 11.0, -1.0])
        cloud = command_to_cloud(wave, bench.sample_period, "flood")
        cloud.header.stamp.nanosec = int(noise.choice([0, 1, 2**32 - 1]))
        command.publish(cloud)
        ask.publish(Float64(data=float(noise.choice([np.nan, -np.inf, 1e300, 10.5, -0.1]))))


def broken_blocks(bench: Bench) -> None:
    """Messages on `samples` that are none."""
    samples = bench.keeper.publisher(PointCloud2, "samples", RELIABLE)
    for _ in range(50):
        cloud = command_to_cloud(np.zeros(500), bench.sample_period, "x" * bench.chance.randrange(2000))
        cloud.width = bench.chance.choice([0, 1, 500, 2**32 - 1])
        cloud.header.stamp.nanosec = bench.chance.choice([0, 2**32 - 1])
        samples.publish(cloud)


def storm_of_parameters(bench: Bench) -> None:
    """Sets what is read only, unknown, of another type, or no number, on both nodes."""
    names = ("ramp_rate", "voltage_max", "model_file", "live_rate", "in_force.stage", "nonsense")
    values = (1.0, float("nan"), "/dev/zero", True, 7, [1.0], "")
    for node in ("driver_node", "model_node"):
        client = bench.keeper.client(SetParameters, f"{node}/set_parameters")
        for _ in range(50):
            named = Parameter(bench.chance.choice(names), value=bench.chance.choice(values))
            client.call_async(SetParameters.Request(parameters=[named.to_parameter_msg()]))
            time.sleep(0.005)


def models_ten_times_a_second(bench: Bench) -> None:
    """Two models in turn on `model`, with texts that are none between them."""
    models = bench.keeper.publisher(String, "model", LATCHED)
    for k in range(21):
        models.publish(String(data=bench.models[k % 2]))
        models.publish(String(data="model: [" * bench.chance.randrange(2000)))
        time.sleep(0.1)
    models.publish(String(data=bench.models[0]))


def hostile_models(bench: Bench) -> None:
    """Texts made to cost the reader time or memory, on `model`."""
    models = bench.keeper.publisher(String, "model", LATCHED)
    for text in hostile_texts(bench.models[0]).values():
        models.publish(String(data=text.encode(errors="ignore").decode()))
        time.sleep(0.05)
    models.publish(String(data=bench.models[0]))


def mutated_commands(bench: Bench) -> None:
    """Commands with sizes, offsets, types and bytes that contradict one another."""
    command = bench.keeper.publisher(PointCloud2, "command", COMMAND)
    for _ in range(200):
        command.publish(mutated(bench.chance, bench.sample_period))
        time.sleep(0.002)


def calls_without_order(bench: Bench) -> None:
    """Stop, cancel and release, a hundred times; and claims by those who do not repeat them."""
    claims = bench.keeper.publisher(KeyValue, "claim", COMMAND)
    for k in range(100):
        word = bench.chance.choice(("stop", "cancel", "release"))
        bench.keeper.client(Trigger, f"driver_node/{word}").call_async(Trigger.Request())
        if k % 10 == 0:
            claims.publish(KeyValue(key=bench.chance.choice(("a", "b", "", "x\ny")), value="claim"))
        time.sleep(0.005)
    for owner in ("a", "b"):
        claims.publish(KeyValue(key=owner, value="release"))
    bench.keeper.client(Trigger, "driver_node/release").call_async(Trigger.Request())


def second_driver(bench: Bench) -> None:
    """A driver of the same topics: it must refuse to stream."""
    if not bench.soaked.refuses_second_driver():
        bench.keeper.break_promise("a second driver on the same topics was not refused")


def slow_subscriber(bench: Bench) -> None:
    """A reliable subscriber of depth 5, ten times slower than the stream, in a thread of its own."""
    node, executor = Node("slow"), SingleThreadedExecutor()
    node.create_subscription(PointCloud2, f"{NAMESPACE}/samples", lambda cloud: time.sleep(0.1), 5)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    time.sleep(bench.chance.uniform(1.0, 3.0))
    executor.shutdown()
    thread.join()
    node.destroy_node()


def foreign_topics(bench: Bench) -> None:
    """Two hundred publishers of other names come and go, with the node that has them."""
    node = Node("foreign")
    for k in range(200):
        node.create_publisher(String, f"/foreign_{k}/samples", 10).publish(String(data="x" * 1000))
    node.destroy_node()


def stop(bench: Bench) -> None:
    """`~/stop` in whatever plays, and `~/release` after a while."""
    for service in ("stop", "release"):
        bench.keeper.client(Trigger, f"driver_node/{service}").call_async(Trigger.Request())
        time.sleep(0.5)


FAULTS: Mapping[str, Callable[[Bench], None]] = {
    "driver stopped for up to 2 s": stall("driver_node", 2.0),
    "model node stopped for up to 4 s": stall("model_node", 4.0),
    "recorder stopped for up to 3 s": stall("recorder", 3.0),
    "driver killed": kill_driver,
    "model node killed": kill_model,
    "recorder killed": kill_recorder,
    "flood of commands": flood_of_commands,
    "broken blocks": broken_blocks,
    "storm of parameters": storm_of_parameters,
    "models ten times a second": models_ten_times_a_second,
    "hostile models": hostile_models,
    "mutated commands": mutated_commands,
    "calls without order": calls_without_order,
    "second driver": second_driver,
    "slow subscriber": slow_subscriber,
    "200 foreign topics": foreign_topics,
    "stop": stop,
}
"""Every fault by its name."""
