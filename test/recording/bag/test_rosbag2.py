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

"""Bags: what the driver sends comes back sample by sample; what is missing, cut or doubled is reported."""

from dataclasses import replace

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from piezo_hysteresis.errors import PiezoError, RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import BagWriter, read, recorded_model, write
from piezo_hysteresis.recording.bag.bag import Bag
from piezo_hysteresis.recording.bag.block_message import TYPE, BlockMessage
from piezo_hysteresis.recording.bag.phase_topic import STRING, PhaseNames

PERIOD = 2e-5
SIZE = 500


class Driver:
    """Sends blocks as the driver node does: running index, phase numbers, stamps on a clock."""

    def __init__(self, bag, axis="", index=0, clock_ns=10**18, seed=0):
        self.bag, self.axis, self.index, self.clock_ns = bag, axis, index, clock_ns
        self.random = np.random.default_rng(seed)
        self.voltage, self.displacement = [], []
        bag.add_topic(f"{axis}/samples", TYPE)
        bag.add_topic(f"{axis}/phase", STRING, depth=1, transient_local=True)

    def phase(self, number, name):
        self.number = number
        self.bag.write(f"{self.axis}/phase", self.clock_ns, PhaseNames.to_cdr(number, name))

    def block(self, voltage=None, n=SIZE):
        voltage = self.random.normal(size=n) if voltage is None else np.full(n, float(voltage))
        return BlockMessage(
            self.clock_ns,
            {"voltage": voltage, "displacement": self.random.normal(size=n) * 1e-6},
            np.full(n, self.number, np.uint32),
            np.arange(n) * PERIOD,
            ((self.index + np.arange(n)) % 2**32).astype(np.uint32),
        )

    def advance(self, block):
        self.index += block.phase.size
        self.clock_ns += round(block.phase.size * PERIOD * 1e9)

    def send(self, block):
        self.bag.write(f"{self.axis}/samples", self.clock_ns, block.to_cdr())

    def play(self, blocks=3, voltage=None):
        sent = []
        for _ in range(blocks):
            block = self.block(voltage)
            self.send(block)
            self.advance(block)
            sent.append(block)
        return sent

    def whole(self):
        self.phase(0, "idle")
        self.play(2, voltage=0.5)
        for number, name in ((1, "step"), (3, "triangle")):
            self.phase(number, name)
            blocks = self.play()
            self.voltage.append(np.concatenate([b.channels["voltage"] for b in blocks]))
            self.displacement.append(np.concatenate([b.channels["displacement"] for b in blocks]))
            self.phase(number + 1, "hold")
            self.play(2, voltage=0.0)
        return self


@pytest.fixture
def whole(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag).whole()
    return tmp_path / "bag", driver


def kinds(experiment):
    return {notice.kind for notice in experiment.notices}


def assert_equal(experiment, driver):
    for record, voltage, displacement in zip(experiment, driver.voltage, driver.displacement, strict=True):
        np.testing.assert_array_equal(record.voltage, voltage)
        np.testing.assert_array_equal(record.displacement, displacement)


def test_phases_are_read_in_order_with_their_state(whole):
    path, driver = whole
    experiment = read(path)
    assert_equal(experiment, driver)
    assert [r.phase for r in experiment] == ["step", "triangle"]
    assert [r.sample_period for r in experiment] == [PERIOD, PERIOD]
    assert [(r.continues, r.truncated, r.initial_voltage) for r in experiment] == [
        (False, False, 0.5),
        (True, False, None),
    ]
    assert experiment[1].start_time == pytest.approx(5 * SIZE * PERIOD, rel=1e-12)


def test_idle_and_hold_are_kept_where_named(whole):
    experiment = read(whole[0], include=("idle", "hold"))
    assert [r.phase for r in experiment] == ["idle", "step", "hold", "triangle", "hold"]
    assert [r.size for r in experiment] == [2 * SIZE, 3 * SIZE, 2 * SIZE, 3 * SIZE, 2 * SIZE]
    assert [r.continues for r in experiment] == [False, True, True, True, True]


def test_a_phase_too_short_to_average_is_left_out(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        for number, name, blocks in ((1, "step", 1), (2, "triangle", 3)):
            driver.phase(number, name)
            driver.play(blocks)
    experiment = read(tmp_path / "bag", average=2 * SIZE)
    assert [r.phase for r in experiment] == ["triangle"]
    assert [n.phase for n in experiment.notices if n.kind == "left_out"] == ["step"]
    assert "averaged" not in kinds(experiment)
    with pytest.raises(RecordingError, match=f"`average`: got {4 * SIZE}, expected at most {3 * SIZE} samples"):
        read(tmp_path / "bag", average=4 * SIZE)


@pytest.mark.parametrize("short", [0, 1, 2])
def test_a_piece_between_gaps_that_is_too_short_to_average_is_dropped(tmp_path, short):
    """The samples that are left keep their times, and the state after a gap is unknown."""
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(1, "triangle")
        for place in range(3):
            driver.play(1 if place == short else 4)
            driver.advance(driver.block())  # is lost
    whole, slow = (read(tmp_path / "bag", average=n) for n in (1, 2 * SIZE))
    kept = [r for r in whole if r.size == 4 * SIZE]
    assert len(slow) == len(kept) == 2
    for record, expected in zip(slow, kept, strict=True):
        np.testing.assert_allclose(record.voltage, expected.decimate(2 * SIZE).voltage, rtol=1e-12)
        assert record.time[0] - slow[0].time[0] == pytest.approx(
            expected.time[0] - kept[0].time[0], abs=2 * SIZE * PERIOD
        )
        assert record.truncated


def test_other_ros_software_opens_the_bag(whole):
    path, _ = whole
    with Reader(path) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {"/samples": 12, "/phase": 5}
        store = get_typestore(Stores.ROS2_KILTED)
        for connection, _, raw in reader.messages():
            store.deserialize_cdr(raw, connection.msgtype)


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_bag_of_other_software_is_the_same_experiment(whole, tmp_path, plugin):
    path, driver = whole
    store = get_typestore(Stores.ROS2_KILTED)
    with Reader(path) as reader, Writer(tmp_path / "other", version=9, storage_plugin=plugin) as writer:
        topics = {c.topic: writer.add_connection(c.topic, c.msgtype, typestore=store) for c in reader.connections}
        for connection, time_ns, raw in reader.messages():
            writer.write(topics[connection.topic], time_ns, raw)
    assert_equal(read(tmp_path / "other"), driver)
    assert_equal(read(next((tmp_path / "other").glob("other.*"))), driver)


def test_one_of_several_stages_is_chosen_by_its_axis(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        drivers = {axis: Driver(bag, axis, seed=i).whole() for i, axis in enumerate(("/stage_x", "/lab/stage_y"))}
    for axis, driver in drivers.items():
        assert_equal(read(tmp_path / "bag", axis=axis), driver)
    assert_equal(read(tmp_path / "bag", axis="stage_x"), drivers["/stage_x"])
    with pytest.raises(RecordingError, match="/lab/stage_y, /stage_x"):
        read(tmp_path / "bag")
    with pytest.raises(RecordingError, match="stage_z"):
        read(tmp_path / "bag", axis="/stage_z")


@pytest.mark.parametrize("index", [0, 2**32 - 700])
def test_a_lost_block_splits_the_phase_also_where_the_index_wraps(tmp_path, index):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag, index=index)
        driver.phase(0, "idle")
        driver.play(1, voltage=0.0)
        driver.phase(1, "noise")
        first = driver.play(2)
        driver.advance(driver.block())
        last = driver.play(3)
    experiment = read(tmp_path / "bag")
    assert [(r.size, r.continues, r.truncated) for r in experiment] == [
        (2 * SIZE, False, False),
        (3 * SIZE, True, True),
    ]
    np.testing.assert_array_equal(experiment[0].voltage, np.concatenate([b.channels["voltage"] for b in first]))
    np.testing.assert_array_equal(experiment[1].voltage, np.concatenate([b.channels["voltage"] for b in last]))
    assert experiment[1].start_time == pytest.approx(3 * SIZE * PERIOD)
    assert any(n.kind == "gap" and str(SIZE) in n.message for n in experiment.notices)


@pytest.mark.parametrize("always", [False, True])
def test_a_pause_during_read_out_is_not_a_loss(tmp_path, always):
    """Unless every block claims to follow one, as clouds of other software may."""
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)

        def played(after_pause):
            if after_pause:
                driver.advance(driver.block())
            for k in range(2):
                block = replace(driver.block(), follows_pause=always or (after_pause and k == 0))
                driver.send(block)
                driver.advance(block)

        driver.phase(0, "idle")
        played(False)
        driver.phase(1, "noise")
        played(True)
        played(True)
    experiment = read(tmp_path / "bag")
    assert [(r.phase, r.size) for r in experiment] == 2 * [("noise", 2 * SIZE)]
    assert [r.truncated for r in experiment] == [always, always]
    assert [r.continues for r in experiment] == [False, True]
    assert experiment[1].start_time == pytest.approx(3 * SIZE * PERIOD)
    assert kinds(experiment) & {"gap", "pause"} == ({"gap"} if always else {"pause"})
    assert any(n.severe for n in experiment.notices) is always


def test_repeated_and_reordered_blocks_are_put_right_and_reported(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(0, "idle")
        driver.play(1, voltage=0.0)
        driver.phase(1, "noise")
        blocks = []
        for _ in range(6):
            blocks.append(driver.block())
            driver.advance(blocks[-1])
        for k in (0, 1, 1, 3, 2, 4, 3, 5):
            driver.send(blocks[k])
    experiment = read(tmp_path / "bag")
    (record,) = experiment
    np.testing.assert_array_equal(record.voltage, np.concatenate([b.channels["voltage"] for b in blocks]))
    assert {"duplicate", "non_monotonic"} <= kinds(experiment)
    assert "gap" not in kinds(experiment)


def test_a_driver_that_starts_again_does_not_continue(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        first = Driver(bag).whole()
        again = Driver(bag, clock_ns=first.clock_ns + 3 * 10**9, seed=1).whole()
    experiment = read(tmp_path / "bag")
    assert [r.phase for r in experiment] == ["step", "triangle"] * 2
    assert [r.continues for r in experiment] == [False, True, False, True]
    np.testing.assert_array_equal(experiment[3].voltage, again.voltage[1])
    assert experiment[2].start_time - experiment[0].start_time == pytest.approx(3 + 12 * SIZE * PERIOD)
    assert "restart" in kinds(experiment)


def test_compressed_messages_are_named_where_the_metadata_are_missing(whole, tmp_path):
    """A recorder that was killed has written no metadata; other topics were proposed."""
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Writer(tmp_path / "packed", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        samples = writer.add_connection("/samples", TYPE, typestore=store)
        for message in Bag(whole[0]).messages(["/samples"]):
            writer.write(samples, message.time_ns, message.raw)
    (tmp_path / "packed" / "metadata.yaml").unlink()
    with pytest.raises(RecordingError, match=r"none of 12 messages could be decoded.*ros2 bag convert"):
        read(tmp_path / "packed")


@pytest.mark.parametrize("back", [0.1, 1.5, 3600.0])
def test_a_driver_that_starts_again_after_its_clock_was_set_back_loses_nothing(tmp_path, back):
    """Its samples have indices that were there before, at other times: they are no repetitions."""
    with BagWriter(tmp_path / "bag") as bag:
        first = Driver(bag)
        first.phase(1, "sine")
        before = first.play(200)
        again = Driver(bag, clock_ns=first.clock_ns - round(back * 1e9), seed=1)
        again.phase(1, "noise")
        after = again.play(200)
    experiment = read(tmp_path / "bag")
    assert [(r.phase, r.continues) for r in experiment] == [("sine", False), ("noise", False)]
    for record, blocks in zip(experiment, (before, after), strict=True):
        np.testing.assert_array_equal(record.voltage, np.concatenate([b.channels["voltage"] for b in blocks]))
    assert "restart" in kinds(experiment) and "duplicate" not in kinds(experiment)


def test_a_bag_that_starts_in_mid_phase_marks_it_truncated(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag, index=12345)
        driver.phase(4, "triangle")
        driver.play()
        driver.phase(5, "sine_50hz")
        driver.play()
    experiment = read(tmp_path / "bag")
    assert [(r.phase, r.truncated, r.continues) for r in experiment] == [
        ("triangle", True, False),
        ("sine_50hz", False, True),
    ]
    assert "truncated" in kinds(experiment)


def test_phases_without_recorded_names_get_proposed_ones(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        bag.add_topic("/phase", STRING)
        for number, frequency in ((1, 50.0), (2, 200.0)):
            driver.number = number
            for _ in range(20):
                block = driver.block()
                time = (driver.index + np.arange(SIZE)) * PERIOD
                block.channels["voltage"][:] = 3.5 + 2.5 * np.sin(2 * np.pi * frequency * time)
                driver.send(block)
                driver.advance(block)
    experiment = read(tmp_path / "bag")
    assert [r.phase for r in experiment] == ["sine_50hz", "sine_200hz"]
    assert "proposed" in kinds(experiment)


def test_a_hold_in_which_the_drive_moves_is_part_of_the_history(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(0, "idle")
        driver.play(1, voltage=0.0)
        driver.phase(1, "noise")
        driver.play()
        driver.phase(2, "hold")
        driver.play(2, voltage=2.0)
        driver.play(2, voltage=0.0)
        driver.phase(3, "noise")
        driver.play()
        driver.phase(4, "hold")
        driver.play(2, voltage=0.0)
    experiment = read(tmp_path / "bag")
    assert [(r.phase, r.size, r.continues) for r in experiment] == [
        ("noise", 3 * SIZE, False),
        ("hold", 4 * SIZE, True),
        ("noise", 3 * SIZE, True),
    ]


def test_a_bag_that_starts_in_a_hold_reports_the_unknown_state(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag, index=777)
        driver.phase(8, "hold")
        driver.play(2, voltage=2.0)
        driver.play(2, voltage=0.25)
        driver.phase(9, "noise")
        driver.play()
    (record,) = experiment = read(tmp_path / "bag")
    assert (record.continues, record.truncated, record.initial_voltage) == (False, False, 0.25)
    assert {"history", "moved"} <= kinds(experiment)


def test_uneven_times_and_undecodable_blocks_are_reported(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(0, "idle")
        driver.play(1, voltage=0.0)
        driver.phase(1, "noise")
        driver.play(4)
        block = driver.block()
        block.time[100:] += 0.5 * PERIOD
        driver.send(block)
        driver.advance(block)
        bag.write("/samples", driver.clock_ns, block.to_cdr()[:1000])
        driver.advance(driver.block())
        driver.play(4)
    experiment = read(tmp_path / "bag")
    assert [r.size for r in experiment] == [5 * SIZE, 4 * SIZE]
    assert {"time_base", "damaged", "gap"} <= kinds(experiment)
    assert any(n.kind == "gap" and n.severe for n in experiment.notices)


def test_the_model_in_a_bag_is_found(whole, tmp_path):
    assert recorded_model(whole[0]) is None
    message = get_typestore(Stores.ROS2_KILTED)
    with BagWriter(tmp_path / "carrying") as bag:
        bag.add_topic("/stage_x/model", STRING, depth=1, transient_local=True)
        for time_ns, text in enumerate(("first", "second")):
            raw = message.serialize_cdr(message.types[STRING](text), STRING)
            bag.write("/stage_x/model", time_ns, raw)
    assert recorded_model(tmp_path / "carrying") == "second"
    assert recorded_model(tmp_path / "carrying", axis="/stage_y") is None


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 23))
def test_a_bag_cut_at_any_byte_gives_all_but_the_last_chunk(tmp_path, share):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(1, "noise")
        sent = np.concatenate([b.channels["voltage"] for b in driver.play(100)])
    file = next((tmp_path / "bag").glob("*.mcap"))
    whole = file.read_bytes()
    cut = int(share * len(whole))
    file.write_bytes(whole[:cut])
    (tmp_path / "bag" / "metadata.yaml").unlink()
    try:
        experiment = read(tmp_path / "bag")
    except PiezoError:
        assert cut < 40_000  # not even the first blocks are there
        return
    got = np.concatenate([r.voltage for r in experiment])
    np.testing.assert_array_equal(got, sent[: got.size])
    assert got.size >= min(sent.size, (cut - 300_000) // 32)
    assert ("cut" in kinds(experiment)) == (cut < len(whole))


def test_writing_an_experiment_and_reading_it_is_exact(tmp_path):
    random = np.random.default_rng(3)
    records = (
        Record(random.normal(size=1203), random.normal(size=1203), PERIOD, "step", initial_voltage=-0.25),
        Record(random.normal(size=900), random.normal(size=900), PERIOD, "noise", 1203 * PERIOD, continues=True),
        Record(random.normal(size=77), random.normal(size=77), 1e-3, "rest", 2103 * PERIOD, continues=True),
        Record(random.normal(size=800), random.normal(size=800), PERIOD, "step", 9.0, initial_voltage=0.0),
    )
    write(Experiment(records), tmp_path / "bag", format="rosbag2")
    experiment = read(tmp_path / "bag")
    for got, sent in zip(experiment, records, strict=True):
        np.testing.assert_array_equal(got.voltage, sent.voltage)
        np.testing.assert_array_equal(got.displacement, sent.displacement)
        assert (got.phase, got.sample_period, got.continues) == (sent.phase, sent.sample_period, sent.continues)
        assert got.initial_voltage == sent.initial_voltage


def test_a_phase_without_a_number_is_left_out_and_the_others_are_read(tmp_path):
    """A sensor that was lost for one phase, or one damaged block of another publisher, cost the whole recording."""
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(0, "idle")
        driver.play(2, voltage=0.0)
        for number, name in enumerate(("step", "noise", "triangle"), 1):
            driver.phase(number, name)
            for _ in range(3):
                block = driver.block()
                if name == "noise":
                    block.channels["displacement"][:] = np.nan
                driver.send(block)
                driver.advance(block)
    experiment = read(tmp_path / "bag")
    assert [(r.phase, r.size, r.truncated) for r in experiment] == [
        ("step", 3 * SIZE, False),
        ("triangle", 3 * SIZE, True),
    ]
    assert [n.phase for n in experiment.notices if "none of its 1500 samples is finite" in n.message] == ["noise"]


def test_a_recording_without_a_number_is_refused(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        driver = Driver(bag)
        driver.phase(1, "step")
        driver.send(replace(driver.block(), channels=dict.fromkeys(("voltage", "displacement"), np.full(SIZE, np.nan))))
    with pytest.raises(PiezoError, match="finite sample"):
        read(tmp_path / "bag")
