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

"""Drivers of several axes in one bag are one recording of a stage of several axes."""

import numpy as np
import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.identification.identify_axes import axes_errors, identify_axes
from piezo_hysteresis.model.axes_samples import columns
from piezo_hysteresis.online import axes_joiner
from piezo_hysteresis.recording import BagWriter, read, write
from piezo_hysteresis.recording.bag import joined_axes
from piezo_hysteresis.recording.bag.block_message import TYPE, BlockMessage

from ...coupled_plant import plant
from .test_rosbag2 import PERIOD, SIZE, Driver, kinds

AXES = ("/stage_x", "/stage_y", "/stage_z")


def recorded(path, late=0.0, lose=False, moving=False):
    """A bag of three drivers that began one after the other, and what each of them sent."""
    sent = {axis: [] for axis in AXES}
    with BagWriter(path) as bag:
        for number, axis in enumerate(AXES):
            begun = 10**18 + round((number * 100 + late * number) * PERIOD * 1e9)
            driver = Driver(bag, axis, index=number * 7, clock_ns=begun, seed=number)
            driver.phase(0, "idle")
            sent[axis] += driver.play(1, voltage=None if moving else 0.25)
            driver.phase(1, "noise")
            sent[axis] += driver.play(2)
            if lose and number == 1:
                driver.advance(driver.block())
            sent[axis] += driver.play(2)
    return path, {axis: {q: np.concatenate([b.channels[q] for b in blocks]) for q in blocks[0].channels}
                  for axis, blocks in sent.items()}  # fmt: skip


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_samples_of_the_same_time_stand_beside_one_another(tmp_path, late):
    bag, sent = recorded(tmp_path / "bag", late)
    (record,) = read(bag, axis=", ".join(AXES))
    assert record.size == 5 * SIZE - 200
    assert not record.truncated
    assert record.settled_voltage == 0.25
    for number, axis in enumerate(AXES, 1):
        first = 200 - 100 * (number - 1)
        for quantity in ("voltage", "displacement"):
            name = f"{quantity}_{number}" if number > 1 else quantity
            expected = sent[axis][quantity][first : first + record.size]
            assert np.array_equal(record.channels[name] if number > 1 else getattr(record, name), expected)


def test_the_order_is_that_of_the_option(tmp_path):
    bag, sent = recorded(tmp_path / "bag")
    (record,) = read(bag, axis="/stage_z,/stage_x")
    assert np.array_equal(record.voltage, sent["/stage_z"]["voltage"][: record.size])
    assert np.array_equal(record.channels["voltage_2"], sent["/stage_x"]["voltage"][200 : 200 + record.size])


def test_what_one_driver_lost_splits_the_recording(tmp_path):
    bag, sent = recorded(tmp_path / "bag", lose=True)
    experiment = read(bag, axis=",".join(AXES))
    assert [record.size for record in experiment] == [3 * SIZE - 100, SIZE - 100]
    assert "gap" in kinds(experiment)
    assert experiment[1].truncated
    y = sent["/stage_y"]["displacement"]
    assert np.array_equal(experiment[1].channels["displacement_2"], y[3 * SIZE :][: experiment[1].size])


def test_a_drive_that_moved_before_all_ran_leaves_the_state_unknown(tmp_path):
    bag, _ = recorded(tmp_path / "bag", moving=True)
    assert read(bag, axis=",".join(AXES))[0].truncated


def played(path, messages, periods=(PERIOD, PERIOD)):
    """A bag of two drivers; a message is driver, number of the block, shift of its stamp [s] and follows_pause."""
    with BagWriter(path) as bag:
        for axis in AXES[:2]:
            bag.add_topic(f"{axis}/samples", TYPE)
        for driver, number, shift, pause in messages:
            count = np.arange(SIZE)
            at = number * SIZE + count
            block = BlockMessage(
                10**18 + round((number * SIZE * periods[driver] + shift) * 1e9),
                {"voltage": np.sin(0.01 * at), "displacement": 1e-6 * at},
                np.zeros(SIZE, np.uint32),
                count * periods[driver],
                at.astype(np.uint32),
                pause,
            )
            bag.write(f"{AXES[driver]}/samples", block.stamp_ns, block.to_cdr())
    return read(path, axis=",".join(AXES[:2]))


def of_both(*numbers, shift=lambda number: 0.0):
    """Messages of both drivers; the stamps of the second are shifted."""
    return [(driver, n, shift(n) if driver else 0.0, False) for n in numbers for driver in range(2)]


def skew(record):
    """Largest difference of the times of two samples that stand beside one another [samples]."""
    return np.abs(record.displacement - record.channels["displacement_2"]).max() / 1e-6


@pytest.mark.parametrize(
    "messages",
    [
        of_both(*range(40)),
        of_both(1, 0, *range(2, 40)),
        of_both(*range(40), shift=lambda n: 1e-3 if n == 0 else 0.0),
    ],
    ids=["in order", "out of order", "a late first stamp"],
)
def test_single_stamps_and_the_order_of_arrival_do_not_matter(tmp_path, messages):
    (record,) = played(tmp_path / "bag", messages)
    assert skew(record) < 1e-6
    assert record.size == 40 * SIZE


@pytest.mark.parametrize("shift", [lambda n: 0.05 * (n >= 20), lambda n: 2e-4 * n], ids=["clock set", "clock drifts"])
def test_stamps_that_contradict_the_index_are_refused(tmp_path, shift):
    with pytest.raises(RecordingError, match=r"/stage_y: the stamps move by 0\.0\d+ s against the index"):
        played(tmp_path / "bag", of_both(*range(40), shift=shift))


def test_another_sample_period_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"/stage_y: got the sample period 2\.01e-05 s, expected 2e-05 s"):
        played(tmp_path / "bag", of_both(*range(4)), periods=(PERIOD, 1.005 * PERIOD))


@pytest.mark.parametrize("both", [True, False])
def test_a_pause_of_all_devices_is_not_a_loss(tmp_path, both):
    messages = [(d, n, 0.0, n == 3 and (both or d == 0)) for n in (0, 1, 3, 4) for d in range(2)]
    experiment = played(tmp_path / "bag", messages)
    assert [record.truncated for record in experiment] == [False, not both]
    assert ("pause" in kinds(experiment)) == both


def test_a_pause_in_which_one_driver_measured_is_a_loss(tmp_path):
    messages = [(d, n, 0.0, n == 4) for n in (0, 1, 2, 4, 5) for d in range(2) if (d, n) != (1, 2)]
    experiment = played(tmp_path / "bag", messages)
    assert [record.truncated for record in experiment] == [False, True]
    assert "gap" in kinds(experiment)


def test_bags_are_joined_by_the_limits_of_the_live_node():
    assert joined_axes.LARGEST_SKEW == axes_joiner.LARGEST_SKEW
    assert joined_axes.PERIOD_TOLERANCE == axes_joiner.PERIOD_TOLERANCE


def test_a_namespace_given_twice_is_refused(tmp_path):
    bag, _ = recorded(tmp_path / "bag")
    with pytest.raises(RecordingError, match="expected every namespace once"):
        read(bag, axis="/stage_x, stage_x")


def test_an_axis_that_is_not_in_the_bag_and_drivers_that_never_ran_together_are_told(tmp_path):
    bag, _ = recorded(tmp_path / "bag")
    with pytest.raises(RecordingError, match="no readable samples of /stage_a"):
        read(bag, axis="/stage_x,/stage_a")
    with pytest.raises(RecordingError, match=r"several stages, expected one; .* all of them with commas between"):
        read(bag)
    with BagWriter(tmp_path / "apart") as writer:
        for number, axis in enumerate(AXES[:2]):
            driver = Driver(writer, axis, clock_ns=10**18 + number * 10**9)
            driver.phase(0, "idle")
            driver.play()
    with pytest.raises(RecordingError, match="got no samples of the same time"):
        read(tmp_path / "apart", axis="/stage_x,/stage_y")


def test_a_bag_with_all_axes_in_one_topic_identifies_them(tmp_path):
    record = plant(1)
    write([record], tmp_path / "axes.mcap")
    (again,) = read(tmp_path / "axes")
    assert np.array_equal(columns(again, "displacement"), columns(record, "displacement"))
    assert max(error.percent for error in axes_errors(identify_axes([again], length=20), [plant(2)])) < 3.0
