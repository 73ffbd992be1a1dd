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

"""Whatever happens to the samples on their way: no false prediction is published as good, and the node recovers.

One model node for all tests here, one stream that goes on through all of them and whose index wraps on the way.
"""

import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import String

from benchmarks.hostile_texts import hostile_texts
from piezo_hysteresis.model.model_file import dumps, save
from piezo_hysteresis.nodes.messages.conversions import to_stamp, values_of
from piezo_hysteresis.nodes.messages.samples import samples_to_cloud
from piezo_hysteresis.nodes.runtime.qos import LATCHED

from .stream import FALSE, MODEL, PERIOD, SIZE, Stream, foreign, predictions, spoilt, with_bytes

pytestmark = pytest.mark.nodes

QUALITY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
FORGOTTEN = 25
"""Blocks of the stream after which loops have forgotten what they were driven to."""


class Bench:
    """The model node, and a publisher in place of a driver."""

    def __init__(self, lab):
        self.lab, self.stream = lab, Stream(first=2**32 - 120 * SIZE)
        self.clouds = lab.listen(PointCloud2, "predicted_samples", QUALITY)
        self.reports = lab.listen(DiagnosticArray, "/diagnostics", 10)
        self._file = str(save(MODEL, lab.folder / "model.yaml"))
        self.start()
        self.samples = lab.publisher(PointCloud2, "samples", QUALITY)
        lab.wait(lambda: lab.node.count_publishers("predicted_samples") > 0, "predicted_samples")
        lab.wait(self._predicts, "the first prediction")

    def start(self):
        """Start the node, for the first time or again."""
        self.node = self.lab.start("model_node", model_file=self._file)

    def predicted(self):
        """Predictions since the last call of `good`."""
        return predictions(self.clouds)

    def _predicts(self):
        self.send(self.stream.block(resting=True))
        time.sleep(0.05)
        return self.clouds

    def send(self, *what):
        for one in what:
            self.samples.publish(one if isinstance(one, PointCloud2) else samples_to_cloud(one))

    def good(self, blocks):
        """Send blocks and return what is reported about all since the last call, once the last one is predicted."""
        last = int(blocks[-1].index[0])
        self.send(*blocks)

        def predicted():
            return last in [index for index, *_ in predictions(self.clouds[-1:])]

        self.lab.wait(predicted, f"the prediction of block {last}", 20.0)
        predicted = predictions(self.clouds)
        del self.clouds[:]
        return predicted

    def figures(self, received=None):
        """The newest figures on /diagnostics."""
        del self.reports[:]
        self.lab.wait(lambda: len(self._own_reports()) > 1, "two reports")
        return values_of(self._own_reports()[-1])

    def _own_reports(self):
        """Those of the node under test: /diagnostics is one topic for all that runs in a domain."""
        return [one for array in list(self.reports) for one in array.status if one.name == "model_node: prediction"]


@pytest.fixture(scope="module")
def shared_bench(shared_lab):
    return Bench(shared_lab)


@pytest.fixture
def bench(shared_bench):
    """The node after a stream in order; whatever the test did, it must recover and have published nothing false."""
    settled = shared_bench.good(shared_bench.stream.blocks(FORGOTTEN))
    assert settled[-1][1]
    yield shared_bench
    predicted = shared_bench.good(shared_bench.stream.blocks(FORGOTTEN))
    assert predicted[-1][1], "recovered"
    assert max(worst for _, dense, worst in predicted if dense) < FALSE
    assert shared_bench.node.is_running


def assert_flagged(predicted, first):
    """Nothing counts from block `first` on until the loops have forgotten; then everything does, and it is right."""
    after = [(dense, worst) for index, dense, worst in predicted if (index - first) % 2**32 < 2**31]
    assert not after[0][0]
    dense = [flag for flag, _ in after]
    assert dense == sorted(dense)
    assert dense[-1]
    assert max(worst for _, good, worst in predicted if good) < FALSE


@pytest.mark.parametrize("lost", [1, 3, 40, 700])
def test_lost_blocks(bench, lost):
    bench.stream.blocks(lost)
    after = bench.stream.blocks(FORGOTTEN)
    assert_flagged(bench.good(after), int(after[0].index[0]))


def test_losses_are_counted(bench):
    before = bench.figures()
    for lost in (1, 5):
        bench.stream.blocks(lost)
        bench.good(bench.stream.blocks(1))
    after = bench.figures()
    assert int(after["lost"]) - int(before["lost"]) == 6 * SIZE
    assert int(after["received"]) - int(before["received"]) == 2 * SIZE


def test_doubled_blocks_count_once(bench):
    blocks = bench.stream.blocks(10)
    predicted = bench.good([b for block in blocks for b in (block, block)] + bench.stream.blocks(1))
    assert [index for index, *_ in predicted] == [int(b.index[0]) for b in blocks] + [predicted[-1][0]]
    assert all(dense and worst < FALSE for _, dense, worst in predicted)


def test_blocks_in_another_order(bench):
    blocks = bench.stream.blocks(10)
    swapped = [*blocks[:4], blocks[5], blocks[4], *blocks[6:], *bench.stream.blocks(FORGOTTEN)]
    predicted = bench.good(swapped)
    assert int(blocks[4].index[0]) not in [index for index, *_ in predicted]
    assert_flagged(predicted, int(blocks[5].index[0]))


def test_samples_of_other_software_are_predicted_as_ours(bench):
    blocks = bench.stream.blocks(10)
    bench.send(*map(foreign, blocks))
    predicted = bench.good(bench.stream.blocks(1))
    assert len(predicted) == 11
    assert all(dense and worst < FALSE for _, dense, worst in predicted)


def cut(block):
    return with_bytes(samples_to_cloud(block), bytes(samples_to_cloud(block).data)[:-7])


def wider(block):
    cloud = samples_to_cloud(block)
    cloud.width *= 2
    return cloud


def another_type(block):
    cloud = samples_to_cloud(block)
    cloud.fields[3].datatype = PointField.FLOAT32
    return cloud


def without(block):
    cloud = samples_to_cloud(block)
    cloud.fields = cloud.fields[:2]
    return cloud


def stamped(block, seconds, nanoseconds):
    cloud = samples_to_cloud(block)
    cloud.header.stamp = to_stamp(0)
    cloud.header.stamp.sec, cloud.header.stamp.nanosec = seconds, nanoseconds
    return cloud


def at(values, value):
    changed = values.copy()
    changed[SIZE // 2] = value
    return changed


BROKEN = {
    "truncated": cut,
    "wider": wider,
    "another type": another_type,
    "without fields": without,
    "empty": lambda block: PointCloud2(),
    "nan voltage": lambda block: spoilt(block, voltage=at(block.voltage, np.nan)),
    "inf displacement": lambda block: spoilt(block, displacement=at(block.displacement, np.inf)),
    "nan time": lambda block: spoilt(block, time=at(block.time, np.nan)),
    "jumping index": lambda block: spoilt(block, index=at(block.index, 7)),
    "uneven times": lambda block: spoilt(block, time=at(block.time, 0.0)),
    "no date": lambda block: stamped(block, 2**31 - 1, 999_999_999),
    "too many nanoseconds": lambda block: stamped(block, 5, 2**32 - 1),
    "times beyond all dates": lambda block: spoilt(block, time=block.time * 1e300),
    "a million megahertz": lambda block: spoilt(block, time=block.time * 1e-9),
    "a sample per month": lambda block: spoilt(block, time=block.time * 1e10),
    "huge voltage": lambda block: spoilt(block, voltage=at(block.voltage, 1e300)),
    "huge displacement": lambda block: spoilt(block, displacement=at(block.displacement, -1e300)),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_block_is_a_lost_one(bench, what):
    broken = bench.stream.block()
    bench.send(BROKEN[what](broken))
    after = bench.stream.blocks(FORGOTTEN)
    assert_flagged(bench.good(after), int(after[0].index[0]))


def test_blocks_of_another_sample_period(bench):
    """One block at half the rate, twenty at half the rate, and back; what the strange ones hold is not this stage."""
    for count in (1, 20):
        strange = bench.stream.blocks(count)
        bench.send(*(replace(block, time=2 * block.time) for block in strange))
        after = bench.stream.blocks(FORGOTTEN)
        first = int(after[0].index[0])
        assert_flagged([one for one in bench.good(after) if (one[0] - first) % 2**32 < 2**31], first)


def test_the_index_wraps(bench):
    while bench.stream.first < 2**32:
        predicted = bench.good(bench.stream.blocks(10))
        assert all(dense and worst < FALSE for _, dense, worst in predicted)
    assert all(dense for _, dense, _ in bench.good(bench.stream.blocks(5)))


def test_random_clouds(bench):
    """Three hundred messages of the right type and no sense."""
    chance = np.random.default_rng(1)
    names = ["time", "voltage", "displacement", "index", "phase", "x", ""]
    for _ in range(300):
        cloud = samples_to_cloud(bench.stream.block()) if chance.random() < 0.5 else PointCloud2()
        for _ in range(chance.integers(1, 4)):
            number = int(chance.choice([0, 1, 2, 31, 32, 2**16, 2**31, 2**32 - 1]))
            what = chance.integers(9)
            if what == 0:
                cloud.width = number
            elif what == 1:
                cloud.height = number
            elif what == 2:
                cloud.point_step = number
            elif what == 3:
                with_bytes(cloud, chance.bytes(int(chance.integers(0, 4000))))
            elif what == 4:
                cloud.header.stamp.nanosec = number
                cloud.header.stamp.sec = int(chance.integers(-(2**31), 2**31))
            elif what == 5:
                cloud.header.frame_id = "x" * int(chance.integers(0, 10_000))
            elif what == 6 and cloud.fields:
                field = cloud.fields[chance.integers(len(cloud.fields))]
                field.name, field.offset = str(chance.choice(names)), number
            elif what == 7 and cloud.fields:
                field = cloud.fields[chance.integers(len(cloud.fields))]
                field.datatype, field.count = int(chance.integers(256)), number
            elif cloud.data:
                data = np.frombuffer(bytes(cloud.data), np.uint8).copy()
                data[chance.integers(data.size, size=8)] = chance.integers(256, size=8)
                with_bytes(cloud, data.tobytes())
        bench.send(cloud)


def test_the_stream_begins_again(bench):
    """A driver that was killed and started again: index and rest from the beginning, stamps later."""
    stamp = bench.stream.stamp + 3_000_000_000
    bench.stream = Stream()
    bench.stream.stamp = stamp
    predicted = bench.good([*bench.stream.blocks(20, resting=True), *bench.stream.blocks(20)])
    assert all(dense and worst < FALSE for _, dense, worst in predicted)


def test_a_stream_that_begins_again_in_a_hold_after_motion(bench):
    """Held at a level that it was driven to before anybody listened: the loops are unknown."""
    stamp = bench.stream.stamp + 3_000_000_000
    bench.stream = Stream(first=5_000)
    bench.stream.stamp = stamp
    bench.stream.blocks(13)
    top, *_ = bench.stream.blocks(3)
    held = [
        replace(top, index=top.index + k * SIZE, stamp=top.stamp + k * round(SIZE * PERIOD * 1e9)) for k in range(3)
    ]
    bench.send(*(spoilt(b, voltage=np.full(SIZE, 4.0), displacement=np.full(SIZE, 4e-6)) for b in held))
    predicted = bench.good(bench.stream.blocks(1))
    assert not any(dense for _, dense, _ in predicted)


def asked(bench, name, value):
    """Whether the node takes a parameter."""
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return bench.lab.call(SetParameters, "model_node/set_parameters", request).results[0].successful


def test_models_many_times_a_second(bench):
    """On the topic and by parameter, with texts that are no model between them: every block is predicted, and well."""
    models = bench.lab.node.create_publisher(String, "model", LATCHED)
    others = [replace(MODEL, provenance={"name": name}) for name in ("one", "other")]
    files = [str(save(model, bench.lab.folder / f"{k}.yaml")) for k, model in enumerate(others)]
    sent, hostile = [], list(hostile_texts(dumps(others[0])).values())
    for k in range(60):
        text = hostile[k // 3 % len(hostile)].encode(errors="ignore").decode()
        models.publish(String(data=dumps(others[k % 2]) if k % 3 else text))
        if k % 5 == 0:
            assert asked(bench, "model_file", files[k % 2])
        blocks = bench.stream.blocks(2)
        bench.send(*blocks)
        sent += blocks
        time.sleep(0.01)
    predicted = bench.good(bench.stream.blocks(1))
    bench.lab.do(lambda: bench.lab.node.destroy_publisher(models))
    assert {int(b.index[0]) for b in sent} <= {index for index, *_ in predicted}
    assert all(dense and worst < FALSE for _, dense, worst in predicted)


def test_a_storm_of_parameters(bench):
    pipe = bench.lab.folder / "pipe"
    os.mkfifo(pipe)
    wrong = {"model_file": ["", "/dev/zero", "/etc/passwd", str(pipe), "/nowhere", 7, True, [1.0]]}
    wrong |= {"live_rate": [10.0, float("nan"), "fast"], "nonsense": [1.0], "rms_time": [-1.0]}
    for name, values in wrong.items():
        for value in values:
            assert not asked(bench, name, value), (name, value)
            assert bench.good(bench.stream.blocks(1))[-1][1]


def test_a_killed_model_node_starts_again_in_mid_stream(bench):
    """Joined in motion: nothing counts until the loops have forgotten."""
    bench.node.signal(signal.SIGKILL)
    bench.node.wait()
    bench.start()
    predicted = []
    bench.send(bench.stream.block())
    while not any(dense for _, dense, _ in predicted):
        predicted = bench.predicted()
        bench.send(bench.stream.block())
        time.sleep(0.02)
    assert_flagged(predicted, predicted[0][0])
