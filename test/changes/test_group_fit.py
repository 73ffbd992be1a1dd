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

"""Recalibration of a group on the last minute: closed changes come back, and others are refused with what will do."""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from piezo_hysteresis.changes.group_fit import fit_groups
from piezo_hysteresis.changes.minute import Minute
from piezo_hysteresis.changes.moved_group import changed_by, group_to_fit
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.change.score import GROUPS
from piezo_hysteresis.online.change.watch import ChangeWatch
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.online.recent_displacement import RecentDisplacement

PERIOD, BLOCK, NOISE = 2e-3, 50, 2e-9
MODEL = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,), delay=2.0)), PERIOD, displacement_scale=1e-5)
SECONDS, CHANGED = 104.0, 74.0
INTERVAL = 3600.0


def drive():
    time = PERIOD * np.arange(round(SECONDS / PERIOD))
    return (
        3.5 + 2.5 * np.sin(2 * np.pi * 11.0 * time) * (time > 0.2) + 0.5 * np.sin(2 * np.pi * 0.7 * time) * (time > 0.2)
    )


def run(model):
    u = drive()
    return model.run(u, model.rest(u[0]))[0]


@cache
def unchanged():
    return run(MODEL)


def feed(streams, y, begin, end):
    """Give the samples of some blocks to watch, predictor and recent samples."""
    u, (watch, predictor, recent) = drive(), streams
    for first in range(begin, end, BLOCK):
        part = slice(first, first + BLOCK)
        if first * PERIOD == 2.0:
            watch.take_baseline(60.0)
        answer = predictor.predict(first, round(first * PERIOD * 1e9), u[part], y[part])
        watch.add(u[part], answer, predictor, round((first + BLOCK) * PERIOD * 1e9))
        recent.add(first, y[part])


def noisy(y, noise, seed):
    return y + noise * np.random.default_rng(seed).standard_normal(y.size)


@cache
def before_change(noise, seed, end):
    """What all streams of this noise have in common: it is copied and goes on."""
    streams = ChangeWatch(INTERVAL), Predictor(PERIOD, MODEL), RecentDisplacement(PERIOD)
    feed(streams, noisy(unchanged(), noise, seed), 0, end)
    return streams


def stream(changed, noise=NOISE, seed=0, changed_at=CHANGED):
    """Watch, predictor and recent samples after a stream that becomes `changed` after some time."""
    y = noisy(np.where(PERIOD * np.arange(changed.size) < changed_at, unchanged(), changed), noise, seed)
    begin = int(changed_at / PERIOD) // BLOCK * BLOCK
    streams = deepcopy(before_change(noise, seed, begin))
    feed(streams, y, begin, y.size)
    return streams


def fit(changed, **options):
    watch, predictor, recent = stream(changed, **options)
    assert watch.since
    minute = Minute(predictor.drive, recent.copy(), predictor.offset)
    return fit_groups(MODEL, minute, watch.baseline, group_to_fit(watch.change.groups), INTERVAL), predictor


@pytest.mark.parametrize(
    ("group", "size"),
    [
        ("gain", 0.004),
        pytest.param("gain", -0.05, marks=pytest.mark.soak),
        pytest.param("loop", 0.03, marks=pytest.mark.soak),
        pytest.param("dynamics", 2e-5, marks=pytest.mark.soak),
        ("dynamics", 1.5e-3),
    ],
)
def test_a_change_is_fitted_within_its_interval_and_the_residual_recovers(group, size):
    true = np.zeros(5)
    true[GROUPS.index(group)] = size
    found, _ = fit(run(changed_by(MODEL, true)))
    k = GROUPS.index(group)
    assert found.groups == (group,)
    assert abs(found.change[k] - size) < 4 * found.deviation[k]
    assert found.deviation[k] < 0.2 * abs(size)
    assert found.after < 1.1 * found.floor < found.before


def test_the_new_model_is_used_with_the_offset_that_was_fitted_with_it():
    """A gain also moves the stage where it rested: the zero that was taken there does not fit the new model."""
    changed = 1.01 * run(MODEL)
    found, predictor = fit(changed)
    predictor.swap(found.model, found.offset)
    u, first = drive()[:BLOCK], round(SECONDS / PERIOD)
    for k in range(20):
        answer = predictor.predict(first + k * BLOCK, round((first + k * BLOCK) * PERIOD * 1e9), u, np.zeros(BLOCK))
    assert answer.model is found.model
    assert predictor.offset == found.offset == pytest.approx(0.0, abs=3e-10)
    assert 0.01 * run(MODEL)[0] > 1e-8


def test_a_change_of_offset_and_gain_is_found():
    found, _ = fit(1.01 * run(MODEL) + 5e-8)
    assert set(found.groups) == {"offset", "gain"}
    assert found.change[0] == pytest.approx(0.01, rel=0.02)
    assert found.offset == pytest.approx(5e-8, rel=0.02)


def test_two_changed_groups_are_both_fitted():
    true = np.zeros(5)
    true[GROUPS.index("gain")], true[GROUPS.index("dynamics")] = 0.01, 2e-4
    found, _ = fit(run(changed_by(MODEL, true)))
    assert set(found.groups) == {"gain", "dynamics"}
    for group in found.groups:
        k = GROUPS.index(group)
        assert abs(found.change[k] - true[k]) < 4 * found.deviation[k]


def test_intervals_have_the_stated_coverage():
    true = np.zeros(5)
    true[GROUPS.index("gain")] = 0.004
    changed, errors = run(changed_by(MODEL, true)), []
    watch, predictor, recent = stream(changed)
    newest = changed[-recent.copy().size :]
    for seed in range(8):
        measured = newest + NOISE * np.random.default_rng(seed).standard_normal(newest.size)
        minute = Minute(predictor.drive, measured, predictor.offset)
        found = fit_groups(MODEL, minute, watch.baseline, "gain", INTERVAL)
        errors.append((found.change[0] - 0.004) / found.deviation[0])
    assert np.count_nonzero(np.abs(errors) < 1.96) >= 6
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 1.7


def test_another_shape_needs_a_full_identification():
    other = MODEL.with_values({"arx.a[0]": -0.9, "arx.b[0]": 0.05})
    with pytest.raises(IdentificationError, match="full identification"):
        fit(run(other))


@pytest.mark.parametrize(
    ("groups", "reason"),
    [
        (("slow",), "slow.*full identification"),
        (("gain", "slow"), "cannot distinguish gain and slow"),
        ((), "nothing to recalibrate"),
    ],
)
def test_a_change_without_a_parameter_of_the_model_is_refused(groups, reason):
    with pytest.raises(IdentificationError, match=reason):
        group_to_fit(groups)


def test_samples_of_the_rest_before_the_drive_are_left_out():
    _, predictor, recent = stream(1.01 * run(MODEL))
    displacement, drive_so_far = recent.copy(), predictor.drive
    short = replace(drive_so_far, slow=np.empty(0), full=drive_so_far.full[-20_000:])
    late = Minute(short, displacement[-20_000:], predictor.offset).scores(MODEL, predictor.offset)
    whole = Minute(short, displacement, predictor.offset).scores(MODEL, predictor.offset)
    assert len(whole) == len(late) == 20_000 // BLOCK
    np.testing.assert_array_equal(whole[-1].value, late[-1].value)


def test_right_after_the_change_there_are_too_few_samples():
    watch, predictor, recent = stream(1.01 * run(MODEL), changed_at=SECONDS - 0.5)
    minute = Minute(predictor.drive, recent.copy(), predictor.offset)
    with pytest.raises(IdentificationError, match="try again later"):
        fit_groups(MODEL, minute, watch.baseline, "gain", INTERVAL)


def test_the_ring_buffer_keeps_the_newest_samples_and_restarts_after_a_gap():
    recent = RecentDisplacement(1.0)
    values = np.arange(200.0)
    for first in range(0, 200, 7):
        recent.add(first, values[first : first + 7])
    np.testing.assert_array_equal(recent.copy(), values[-60:])
    recent.add(250, values[:5])
    np.testing.assert_array_equal(recent.copy(), values[:5])
