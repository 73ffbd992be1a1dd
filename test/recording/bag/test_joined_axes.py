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
from piezo_hysteresis.recording import BagWriter, read, write

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
