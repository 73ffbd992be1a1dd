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

"""A replayed recording gives back its samples, whatever drive is asked for, and says so."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.replay import ReplayStage
from piezo_hysteresis.stage.stage import Stage, StreamingStage

VOLTAGE = np.linspace(1.0, 6.0, 50)
DISPLACEMENT = 5e-6 * VOLTAGE
RECORDS = Record(VOLTAGE, DISPLACEMENT, 1e-3, "triangle").split(20)


@given(st.lists(st.integers(1, 20), min_size=1, max_size=5))
def test_blocks_of_any_size_give_the_recording_then_hold_its_last_sample(sizes):
    stage = ReplayStage(RECORDS)
    got = [stage.exchange(np.full(n, 99.0)) for n in sizes]
    index = np.minimum(np.arange(sum(sizes)), 49)
    np.testing.assert_array_equal(np.concatenate([g.voltage for g in got]), VOLTAGE[index])
    np.testing.assert_array_equal(np.concatenate([g.displacement for g in got]), DISPLACEMENT[index])
    assert stage.finished is (sum(sizes) >= 50)
    assert stage.voltage == VOLTAGE[index[-1]]
    assert stage.read_displacement() == DISPLACEMENT[index[-1]]


def test_repetition_begins_again_after_the_last_sample():
    stage = ReplayStage(RECORDS, repeat=True)
    np.testing.assert_array_equal(stage.exchange(np.zeros(120)).voltage, np.tile(VOLTAGE, 3)[:120])
    assert not stage.finished


def test_the_description_identifies_a_replay():
    stage = ReplayStage(Experiment(RECORDS), name="picma")
    promised = {n for part in (Stage, StreamingStage) for n in vars(part) if not n.startswith("_")}
    assert promised <= set(dir(stage))
    description = stage.description
    assert (description.ignores_drive, description.streaming, description.measured_voltage) == (True, True, True)
    assert (description.voltage_min, description.voltage_max, description.safe_voltage) == (1.0, 6.0, 1.0)
    assert stage.sample_period == 1e-3
    stage.configure(1e-3)
    with pytest.raises(StageError, match="sample period"):
        stage.configure(2e-3)


def test_the_record_being_played_is_known():
    stage = ReplayStage(RECORDS)
    seen = []
    while not stage.finished:
        seen.append(stage.record.continues)
        stage.exchange(np.zeros(10))
    assert seen == [False, False, True, True, True]


def test_driving_a_recording_changes_nothing():
    stage = ReplayStage(RECORDS)
    stage.exchange(np.zeros(5))
    stage.set_voltage(3.3)
    stage.safe()
    assert stage.voltage == VOLTAGE[4]
    stage.close()
    with pytest.raises(StageError, match="closed"):
        stage.exchange(np.zeros(1))


def test_channels_are_replayed_where_every_record_has_them():
    full = Record(
        VOLTAGE, DISPLACEMENT, 1e-3, channels={"other_displacement": 2 * DISPLACEMENT, "temperature": VOLTAGE + 290}
    )
    got = ReplayStage([full]).exchange(np.zeros(10))
    np.testing.assert_array_equal(got.channels["other_displacement"], 2 * DISPLACEMENT[:10])
    np.testing.assert_array_equal(got.channels["temperature"], VOLTAGE[:10] + 290)
    assert ReplayStage([full, RECORDS[0]]).exchange(np.zeros(10)).channels == {}


def slow_ramp(period, count):
    """A ramp of 3 V/s, stored as averages over `period`."""
    return Record(3.0 * period * (np.arange(count) + 0.5), np.zeros(count), period, "ramp")


@given(factor=st.integers(2, 9), cuts=st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_slow_phases_are_played_between_the_centres_of_their_averages(factor, cuts):
    fast, slow = Record(VOLTAGE, DISPLACEMENT, 1e-3, "triangle"), slow_ramp(1e-3 * factor, 12)
    stage = ReplayStage([fast, slow])
    assert stage.sample_period == 1e-3
    assert stage.phases == (("triangle", 50), ("ramp", 12 * factor))
    assert "1 of 2 phases" in stage.notices[0]
    assert "ramp" in stage.notices[0]
    got = np.concatenate([stage.exchange(np.zeros(n)).voltage for n in [*cuts, 50 + 12 * factor]])
    np.testing.assert_array_equal(got[:50], VOLTAGE)
    inside = slice(factor, 11 * factor)  # the ends are held for half a slow sample
    ramp = got[50 : 50 + 12 * factor]
    np.testing.assert_allclose(ramp[inside], 3e-3 * (np.arange(12 * factor) + 0.5)[inside], rtol=1e-12)


def test_a_longer_period_is_played_as_averages():
    stage = ReplayStage(RECORDS[:2], sample_period=2e-3)
    got = stage.exchange(np.zeros(25))
    np.testing.assert_allclose(got.voltage, VOLTAGE.reshape(25, 2).mean(axis=1), rtol=1e-15)
    assert stage.finished
    assert ReplayStage(RECORDS).notices == ()


def test_recordings_that_cannot_be_replayed_in_one_go_are_refused():
    with pytest.raises(StageError, match="no record"):
        ReplayStage([])
    with pytest.raises(StageError, match="whole multiple"):
        ReplayStage(RECORDS, sample_period=2.5e-3)
    with pytest.raises(StageError, match="at least one sample"):
        ReplayStage(RECORDS).exchange(np.zeros(0))
