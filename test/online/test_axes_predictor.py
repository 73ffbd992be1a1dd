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

"""The predictor of several axes is the model, carried from block to block; what it does not know, it tells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.errors import ParameterError, RecordError
from piezo_hysteresis.model.axes_model import AxesModel
from piezo_hysteresis.online.axes_predictor import AxesPredictor

PERIOD = 1e-3
TAPS = 30


def made_model(memory=0.05):
    """Two drives, two displacements, a lag of five samples, and plays that add to the second pass."""
    decay = np.exp(-np.arange(TAPS)[::-1] / 5.0)
    gains = 1e-6 * np.array([[2.0, 0.5], [-0.7, 1.5]])
    taps = np.zeros((2, 2, TAPS, 2 * (3 + 2)))
    taps[:, :, :, :2] = gains[None, :, None, :] * decay[None, None, :, None] / decay.sum()
    taps[1, :, :, 6:8] = 0.2 * gains[:, None, :] * decay[None, :, None] / decay.sum()
    taps[:, :, :, 2:4] = 0.1 * taps[:, :, :, :2]
    return AxesModel(taps, np.linalg.inv(gains), np.array([0.1, 0.4]), np.array([1e-7, -2e-7]), PERIOD, 1.0, memory)


MODEL = made_model()


def drives(size, seed=1):
    return np.random.default_rng(seed).standard_normal((size, 2)).cumsum(axis=0) / 5.0


def from_rest(u):
    """The displacements of the stage after it has rested at 0 V."""
    return MODEL.run(u, MODEL.rest())[0]


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf")])
def test_a_time_that_is_none_is_refused_as_by_the_predictor_of_one_axis(wrong):
    with pytest.raises(ParameterError, match="rms_time: got"):
        AxesPredictor(MODEL, rms_time=wrong)


def test_a_displacement_that_is_no_number_is_refused_and_leaves_the_offset():
    """One displacement that was NaN made the offset NaN, and with it every later prediction."""
    predictor, at_rest = AxesPredictor(MODEL), np.zeros((40, 2))
    predictor.predict(at_rest, at_rest + 1e-9, restarted=True)
    with pytest.raises(RecordError, match="displacements: got samples"):
        predictor.predict(at_rest, np.full(at_rest.shape, np.nan))
    answer = predictor.predict(at_rest, at_rest + 1e-9)
    assert answer.warming_up and np.abs(answer.residual).max() < 1e-15


@given(st.lists(st.integers(1, 80), min_size=1, max_size=8))
def test_every_cutting_gives_the_bits_of_the_model(sizes):
    u = np.concatenate((np.zeros((20, 2)), drives(sum(sizes))))
    expected = from_rest(u)
    predictor = AxesPredictor(MODEL)
    at = 0
    for size in (20, *sizes):
        answer = predictor.predict(u[at : at + size], np.zeros((size, 2)), restarted=at == 0)
        assert np.array_equal(answer.prediction, expected[at : at + size] + predictor.offset)
        at += size


def run_through(u, y, size=50, **first):
    """Answers of a new predictor to blocks of a recording, and the predictor."""
    predictor = AxesPredictor(MODEL)
    answers = [
        predictor.predict(u[a : a + size], y[a : a + size], **(first if a == 0 else {})) for a in range(0, len(u), size)
    ]
    return predictor, answers


def test_the_offsets_of_the_sensors_are_measured_at_the_beginning():
    u = np.concatenate((np.zeros((200, 2)), drives(800)))
    y = from_rest(u) + np.array([3e-6, -4e-6])
    predictor, answers = run_through(u, y, restarted=True)
    assert predictor.offset == pytest.approx([3e-6, -4e-6], abs=1e-15)
    assert not any(answer.warming_up for answer in answers)
    assert np.abs(np.concatenate([answer.residual for answer in answers])).max() < 1e-14
    assert max(predictor.residual_rms) < 1e-14


def test_a_stage_that_rests_at_another_voltage_is_predicted_from_there():
    slow = np.concatenate((np.linspace(0.0, 3.0, 2000)[:, None] * [1.0, -0.5], np.tile([3.0, -1.5], (1000, 1))))
    u = np.concatenate((slow, np.array([3.0, -1.5]) + drives(1000)))
    y = from_rest(u)
    _, answers = run_through(u[2900:], y[2900:], restarted=True)
    assert not any(answer.warming_up for answer in answers)
    residual = np.concatenate([answer.residual for answer in answers])
    assert np.abs(residual).max() < 1e-4 * np.ptp(y)


def test_a_stream_joined_in_motion_warms_up_and_is_then_predicted():
    u = drives(6000)
    y = from_rest(u)
    _, answers = run_through(u[1000:], y[1000:], restarted=True, settled=False)
    flags = [answer.warming_up for answer in answers]
    settled = flags.index(False)
    assert flags == [True] * settled + [False] * (len(flags) - settled)
    assert settled * 50 >= MODEL.settling
    residual = np.concatenate([answer.residual for answer in answers[settled + 3 :]])
    assert np.abs(residual).max() < 1e-3 * np.ptp(y)


@pytest.mark.parametrize("held", [True, False])
def test_missing_samples_are_bridged_with_the_last_voltages(held):
    u = drives(3000)
    u[:1] = 0.0
    if held:
        u[1000:1100] = u[999]
    y = from_rest(u)
    predictor, _ = run_through(u[:1000], y[:1000], restarted=True)
    answer = predictor.predict(u[1100:1150], y[1100:1150], 100, follows_gap=held)
    assert answer.warming_up == (not held)
    if held:
        assert np.abs(answer.residual).max() < 1e-13
    answers = [predictor.predict(u[a : a + 50], y[a : a + 50]) for a in range(1150, 3000, 50)]
    assert not answers[-1].warming_up
    assert np.abs(answers[-1].residual).max() < 1e-3 * np.ptp(y)


def test_an_actuator_that_does_not_move_keeps_its_unknown_state():
    u = drives(3000) * [1.0, 0.0]
    _, answers = run_through(u, from_rest(u), restarted=True, settled=False)
    assert answers[-1].warming_up


def test_other_numbers_of_axes_are_refused_and_leave_the_state_unknown():
    predictor = AxesPredictor(MODEL)
    predictor.predict(np.zeros((5, 2)), np.zeros((5, 2)), restarted=True)
    with pytest.raises(RecordError, match="got 3 drives and 2 displacements, expected 2 and 2"):
        predictor.predict(np.zeros((5, 3)), np.zeros((5, 2)))
    assert predictor.predict(np.zeros((5, 2)), np.zeros((5, 2))).warming_up
