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

"""The change watch on simulated streams: what it finds, what it leaves alone, and what it says it cannot see."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from piezo_hysteresis.effects import Arx, BoucWen, Creep, HysteresisMemory
from piezo_hysteresis.errors import ModelError, ParameterError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_parameters import model_hash
from piezo_hysteresis.online.change.baseline import Baseline, drive_class
from piezo_hysteresis.online.change.detector import ChangeDetector
from piezo_hysteresis.online.change.false_alarm_threshold import (
    CLEARED,
    WINDOW,
    correlate,
    count_alarms,
    false_alarm_threshold,
    inflation,
    largest_windows,
    moving_average,
)
from piezo_hysteresis.online.change.scatter import Scatter
from piezo_hysteresis.online.change.score import GROUPS, ChangeScore
from piezo_hysteresis.online.change.watch import ChangeWatch, baseline_path
from piezo_hysteresis.online.predictor import Predictor

PERIOD = 2e-3
BLOCK = 50
MODEL = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,))), PERIOD, displacement_scale=1e-5)
SPAN = 4.2e-6
TRAINED, WATCHED = 60.0, 30.0


def sine(seconds, frequency=11.0, amplitude=2.5, period=PERIOD):
    time = period * np.arange(round(seconds / period))
    return 3.5 + amplitude * np.sin(2 * np.pi * frequency * time) * (time > 0.2)


def follow(drive, displacement, seed=0, baseline=None, noise=5e-4, model=MODEL):
    """The watch after a stream, and the largest statistic after the baseline."""
    rng = np.random.default_rng(seed)
    measured = displacement + noise * SPAN * rng.standard_normal(displacement.size)
    period = model.sample_period
    predictor, watch = Predictor(period, model), ChangeWatch(3600.0, baseline)
    largest = 0.0
    for first in range(0, drive.size - BLOCK + 1, BLOCK):
        part = slice(first, first + BLOCK)
        if first == round(2.0 / period) and baseline is None:
            watch.take_baseline(TRAINED)
        answer = predictor.predict(first, round(first * period * 1e9), drive[part], measured[part])
        watch.add(drive[part], answer, predictor, round((first + BLOCK) * period * 1e9))
        largest = max(largest, watch.change.statistic)
    return watch, largest


def play(predictor, watch, drive, measured):
    """Give a stream to the watch, block by block."""
    for first in range(0, drive.size - BLOCK + 1, BLOCK):
        part = slice(first, first + BLOCK)
        answer = predictor.predict(first, round(first * PERIOD * 1e9), drive[part], measured[part])
        watch.add(drive[part], answer, predictor, round((first + BLOCK) * PERIOD * 1e9))


def run(model, drive):
    return model.run(drive, model.rest(drive[0]))[0]


@pytest.fixture(scope="module")
def drive():
    return sine(TRAINED + WATCHED + 4.0)


def with_change(drive, group):
    y, late = run(MODEL, drive), drive.size - round(WATCHED / 2 / PERIOD)
    other = y.copy()
    if group == "gain":
        other = 1.002 * y
    elif group == "offset":
        other = y + 1e-3 * SPAN
    elif group == "loop":
        other = run(MODEL.with_values({"bouc_wen.A": 1.03 * MODEL.values()["bouc_wen.A"]}), drive)
    elif group == "dynamics":
        other = np.interp(PERIOD * np.arange(y.size) - 3e-5, PERIOD * np.arange(y.size), y)
    return np.where(np.arange(y.size) < late, y, other), late


@cache
def unchanged(seed=0):
    """Watch and largest statistic of a stage that does not change."""
    drive = sine(TRAINED + WATCHED + 4.0)
    return follow(drive, run(MODEL, drive), seed)


@cache
def changed(group):
    """Watch of a stage that changes, and the sample of the change."""
    displacement, late = with_change(drive := sine(TRAINED + WATCHED + 4.0), group)
    return follow(drive, displacement)[0], late


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.soak) for seed in (1, 2))])
def test_an_unchanged_stage_raises_no_alarm(seed):
    watch, largest = unchanged(seed)
    assert watch.alarms == 0
    assert 0.05 < largest < 1.0


@pytest.mark.parametrize(
    "frequency", [0.3, pytest.param(1.0, marks=pytest.mark.soak), pytest.param(3.0, marks=pytest.mark.soak)]
)
def test_a_slow_scan_whose_blocks_differ_raises_no_alarm(frequency):
    slow = sine(TRAINED + WATCHED + 4.0, frequency)
    watch, largest = follow(slow, run(MODEL, slow))
    assert watch.alarms == 0
    assert 0.05 < largest < 1.0


@pytest.mark.parametrize(
    "frequency", [pytest.param(0.3, marks=pytest.mark.soak), 1.0, pytest.param(11.0, marks=pytest.mark.soak)]
)
def test_white_scores_vary_alike_in_all_directions_whatever_each_block_excites(frequency):
    slow = sine(TRAINED + 4.0, frequency)
    watch, _ = follow(slow, run(MODEL, slow))
    for scatter in watch.baseline.scatter.values():
        known = np.linalg.eigvalsh(scatter.precision)
        assert known[-1] < 4.0 * known[0]


def test_the_mean_of_a_class_is_as_uncertain_as_its_own_scores_make_it():
    slope = np.diag([1.0, 1.0, 1.0, 1.0, 1.0])
    few, many = (Scatter(n, np.zeros(5), np.eye(5), slope, np.zeros((2, 5)), np.zeros(5), 1.0) for n in (100, 10_000))
    scores = [ChangeScore(np.ones(5), slope, span, 1.0, k, 1.0) for k, span in enumerate((100.0, 1.0, 1.0, 1.0))]
    classes = [drive_class(scores[0]), drive_class(scores[1])]
    detector = ChangeDetector(Baseline(dict(zip(classes, (few, many), strict=True))), 600.0, same_offset=True)
    for score in scores:
        change = detector.add(score)
    expected = (1.0 + (3.0**2 / 10_000 + 1.0 / 100) / 4.0) / 4.0
    assert change.deviation**2 == pytest.approx(expected)


def test_a_drift_during_the_baseline_is_no_reason_to_be_blind():
    """The gain grew by 0.15 % in a baseline of 15 s. Then a gain 0.5 % higher was no change: the threshold was 10⁹."""
    drive = sine(40.0, 0.5) * (0.8 + 0.2 * sine(40.0, 0.1, 1.0) / 4.5)
    drifting = run(MODEL, drive) * (1.0 + 1e-4 * PERIOD * np.arange(drive.size))
    rng = np.random.default_rng(5)
    measured = drifting + 5e-4 * SPAN * rng.standard_normal(drive.size)
    predictor, watch = Predictor(PERIOD, MODEL), ChangeWatch(86400.0)
    watch.take_baseline(15.0)
    with pytest.raises(ModelError, match=r"worth .* independent ones, expected at least 8"):
        play(predictor, watch, drive, measured)
    assert watch.baseline is None


@pytest.mark.parametrize("group", ["gain", "loop", "dynamics", "offset"])
def test_a_change_is_found_with_its_group_and_its_onset(group):
    watch, late = changed(group)
    assert watch.alarms == 1
    assert watch.change.statistic > 1.0
    assert group in watch.change.groups
    assert abs(watch.since * 1e-9 - late * PERIOD) < 1.0


def test_a_lag_is_not_named_slow_although_both_turn_a_fast_sine_by_a_quarter_of_a_cycle():
    """The slow group is almost only the mean, and what it adds to a fast sine has the direction of a lag."""
    fast, lag = replace(MODEL, sample_period=5e-4), 3e-6
    drive = sine(TRAINED + 24.0, 20.0, period=5e-4)
    y = run(fast, drive)
    late = np.arange(y.size) > drive.size - round(WATCHED / 2 / 5e-4)
    watch, _ = follow(drive, y - np.where(late, lag * np.gradient(y, 5e-4), 0.0), model=fast)
    assert watch.change.groups == ("dynamics",)
    assert abs(watch.change.estimate - lag) < 3.0 * watch.change.deviation


def watched(period, seconds, block, *, change=np.inf, baseline=20.0):
    """A watch of a stage whose gain changes at a time [s], in blocks of samples, and when its baseline ended [s]."""
    model = Model((BoucWen(),), period, displacement_scale=1e-5)
    time = period * np.arange(round(seconds / period))
    drive = 3.0 * (1.0 - np.cos(0.2 / period * np.maximum(time - 1.0, 0.0) * 2 * np.pi * 0.01))
    y = run(model, drive) * np.where(time >= change, 1.01, 1.0)
    y += 1e-9 * np.random.default_rng(3).standard_normal(time.size)
    predictor, watch, ended = Predictor(period, model), ChangeWatch(600.0), np.nan
    watch.take_baseline(baseline)
    for first in range(0, time.size, block):
        part = slice(first, first + block)
        answer = predictor.predict(first, round(first * period * 1e9), drive[part], y[part])
        last = first + drive[part].size - 1
        if watch.add(drive[part], answer, predictor, round(last * period * 1e9)) is not None:
            ended = last * period
    return watch, ended


def test_a_baseline_takes_the_time_that_was_asked_for_at_slow_samples():
    """A score covers 16 samples at least, and was counted as 0.1 s."""
    _, ended = watched(0.1, 340.0, 10, baseline=300.0)
    assert ended == pytest.approx(300.0, abs=4.0)


@pytest.mark.parametrize("block", [100, pytest.param(2000, marks=pytest.mark.soak), 5000])
def test_the_onset_does_not_depend_on_the_blocks_of_the_stream(block):
    """All scores of a block had the time of its end."""
    watch, _ = watched(1e-3, 80.0, block, change=60.0)
    assert watch.since * 1e-9 == pytest.approx(60.0, abs=0.15)


def test_invalid_times_are_refused():
    for wrong in (-5.0, 0.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="expected"):
            ChangeWatch(wrong)
        with pytest.raises(ParameterError, match="expected"):
            ChangeWatch(600.0).take_baseline(wrong)


def test_the_loop_of_play_operators_is_watched(drive):
    """A model that `identify` finds without broadband records has no other loop."""
    plays = HysteresisMemory(c=(0.05,) * 6, reach=0.6, virgin=1.0)
    model = MODEL.with_hysteresis(BoucWen().memoryless()).with_effect(plays)
    other = model.with_effect(plays.with_values(c=(0.055,) * 6))
    late = np.arange(drive.size) >= drive.size - round(WATCHED / 2 / PERIOD)
    watch, _ = follow(drive, np.where(late, run(other, drive), run(model, drive)), model=model)
    assert watch.alarms == 1
    assert "loop" in watch.change.groups


def test_the_estimate_of_a_gain_lies_within_its_interval():
    watch, _ = changed("gain")
    assert watch.change.groups[0] == "gain"
    assert abs(watch.change.estimate - 2e-3) < 4 * watch.change.deviation


def test_a_misfit_in_the_baseline_is_not_a_change(drive):
    creeping = MODEL.with_effect(Creep(gamma=0.02))
    watch, _ = follow(drive, run(creeping, drive))
    assert watch.alarms == 0


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.soak)])
def test_a_recalibrated_model_raises_no_alarm_at_whatever_moment_it_is_used(seed):
    """Its sensitivities begin at another phase of the drive than those of the baseline."""
    u = sine(85.0)
    measured = run(MODEL, u) + 5e-4 * SPAN * np.random.default_rng(seed).standard_normal(u.size)
    new = MODEL.with_values({"bouc_wen.A": (1.0 + 1e-7) * MODEL.values()["bouc_wen.A"]})
    predictor, watch = Predictor(PERIOD, MODEL), ChangeWatch(3600.0)
    largest = 0.0
    for first in range(0, u.size - BLOCK + 1, BLOCK):
        part = slice(first, first + BLOCK)
        if first == BLOCK * 10:
            watch.take_baseline(20.0)
        elif first == BLOCK * (360 + 13 * seed):
            watch.baseline = watch.baseline.of_model(model_hash(new))
            predictor.swap(new, predictor.offset)
        answer = predictor.predict(first, round(first * PERIOD * 1e9), u[part], measured[part])
        watch.add(u[part], answer, predictor, round((first + BLOCK) * PERIOD * 1e9))
        largest = max(largest, watch.change.statistic)
    assert watch.alarms == 0
    assert largest > 0.0


def test_another_drive_than_those_of_the_baseline_is_not_watched():
    watch, _ = unchanged()
    other = sine(8.0, frequency=40.0, amplitude=0.1)
    watch, largest = follow(other, run(MODEL, other), baseline=watch.baseline)
    assert not watch.change.watched
    assert largest == 0.0


def test_at_constant_voltage_only_the_offset_is_watched():
    held = np.full(round((TRAINED + WATCHED) / PERIOD), 3.5)
    watch, _ = follow(held, run(MODEL, held))
    (scatter,) = watch.baseline.scatter.values()
    assert [g for g, seen in zip(GROUPS, scatter.excited, strict=True) if seen] == ["offset"]


def test_a_baseline_outlives_the_process_and_belongs_to_its_model(drive, tmp_path):
    watch, _ = unchanged()
    path = baseline_path(tmp_path, model_hash(MODEL))
    watch.baseline.save(path)
    loaded = Baseline.load(path)
    displacement, _ = with_change(drive, "gain")
    assert follow(drive, displacement, baseline=loaded)[0].alarms == 1
    foreign = replace(loaded, model="sha256:0")
    begin = slice(round(20.0 / PERIOD))
    assert follow(drive[begin], displacement[begin], baseline=loaded)[1] > 0.0
    assert follow(drive[begin], displacement[begin], baseline=foreign)[1] == 0.0


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"no archive at all"])
def test_a_file_that_is_no_baseline_is_refused(tmp_path, content):
    path = tmp_path / "baseline.npz"
    path.write_bytes(content)
    with pytest.raises(ModelError, match="take a new one"):
        Baseline.load(path)


@pytest.mark.parametrize(("byte", "value"), [(8, 1), (10, 19), (10, 8)], ids=["flag", "unknown method", "other method"])
def test_a_damaged_baseline_is_refused(tmp_path, byte, value):
    watch, _ = unchanged()
    path = tmp_path / "baseline.npz"
    watch.baseline.save(path)
    content = bytearray(path.read_bytes())
    content[content.index(b"PK\x01\x02") + byte] = value  # in the directory of the archive
    path.write_bytes(content)
    with pytest.raises(ModelError, match="take a new one"):
        Baseline.load(path)


def test_a_baseline_of_an_earlier_version_is_refused(tmp_path):
    watch, _ = unchanged()
    path = tmp_path / "baseline.npz"
    watch.baseline.save(path)
    with np.load(path) as file:
        earlier = {name: file[name] for name in file.files if name != "format"}
    np.savez(path, **earlier)
    with pytest.raises(ModelError, match=r"another version wrote it.*take a new one"):
        Baseline.load(path)


def test_too_short_a_baseline_is_refused():
    with pytest.raises(ModelError, match="expected at least"):
        Baseline.of([])


def test_sums_of_correlated_scores_vary_as_an_autoregressive_series_does():
    phi = 0.7
    scatter = Scatter(100, np.zeros(5), np.eye(5), np.eye(5), np.array([[phi] * 5, [phi] * 5]), np.zeros(5), 1.0)
    k = 40
    correlation = phi ** np.abs(np.subtract.outer(np.arange(k), np.arange(k)))
    assert scatter.inflation(k)[-1, 0] == pytest.approx(correlation.sum() / k)
    assert scatter.inflation(k)[0, 0] == 1.0


def test_the_window_is_long_enough_for_a_change_as_large_as_a_residual_that_is_correlated_over_two_blocks():
    memory = np.full((2, 1), np.exp(-0.5))
    threshold = false_alarm_threshold(np.eye(1), 6000.0, memory)
    assert WINDOW / inflation(memory, WINDOW)[-1, 0] > threshold


@pytest.mark.parametrize("phi", [0.0, 0.65])
def test_the_threshold_keeps_the_rate_of_false_alarms(phi):
    memory = np.full((2, 2), phi)
    level = false_alarm_threshold(np.eye(2), 1000.0, memory, seed=1)
    white = np.random.default_rng(2).standard_normal((200_000, 2))
    total = np.cumsum(lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], white, axis=0), axis=0)
    above = np.zeros(len(total), bool)
    for k, variance in enumerate(inflation(memory, 60)[:, 0], 1):
        above[k:] |= ((total[k:] - total[:-k]) ** 2 / (k * variance)).max(axis=1) > level
    alarms = 1 + np.count_nonzero(np.diff(np.flatnonzero(above)) > 60)
    assert 150 < alarms < 270  # 200 wanted


def test_a_threshold_for_rarer_alarms_than_are_simulated_continues_the_rate():
    white = np.random.default_rng(3).standard_normal((2_000_000, 1))
    largest = np.zeros(len(white))
    largest_windows(white, np.ones((60, 1)), largest)
    level = false_alarm_threshold(np.eye(1), 20_000.0)  # twenty in all that is simulated for the threshold
    alarms = count_alarms(largest, level, CLEARED * level)
    assert 60 < alarms < 150  # 100 wanted


@pytest.mark.parametrize(("first", "decay"), [(0.3, 0.8), (0.73, 0.6), (0.5, 0.0), (0.0, 0.0)])
def test_scores_that_are_simulated_have_the_memory_of_the_baseline(first, decay):
    memory = np.array([[first], [decay]])
    series = np.random.default_rng(4).standard_normal((400_000, 1))
    correlate(series, memory[1], moving_average(memory))
    correlation = [np.mean(series[k:] * series[: series.size - k]) for k in range(4)]
    assert correlation == pytest.approx([1.0, first, first * decay, first * decay**2], abs=0.02)


@pytest.mark.parametrize(
    ("frequency", "gamma", "noise"),
    [
        (0.37, 0.02, 1e-4),
        pytest.param(0.37, 0.03, 5e-4, marks=pytest.mark.soak),
        pytest.param(1.0, 0.03, 5e-4, marks=pytest.mark.soak),
    ],
)
def test_creep_that_the_model_describes_badly_is_no_change(frequency, gamma, noise):
    """The zero moves on. In half a scan this resembles a lag or a gain, and there were 20 to 40 alarms."""
    drive = sine(130.0, frequency)
    stage, model = (MODEL.with_effect(Creep(gamma=g, tau_min=PERIOD)) for g in (0.015, gamma))
    watch, largest = follow(drive, run(stage, drive), model=model, noise=noise)
    assert watch.alarms == 0 and largest < 1.0


@pytest.mark.parametrize("group", ["gain", *(pytest.param(g, marks=pytest.mark.soak) for g in ("dynamics", "offset"))])
def test_a_change_beside_such_creep_has_its_name(group):
    drive = sine(160.0, 1.0)
    stage, model = (MODEL.with_effect(Creep(gamma=g, tau_min=PERIOD)) for g in (0.015, 0.02))
    late = np.arange(drive.size) >= round(130.0 / PERIOD)
    y = run(stage, drive)
    slower = run(stage.with_values({"arx.delay": 2.0}), drive)
    changed = {"gain": 1.01 * y, "dynamics": slower, "offset": y + 3e-8}[group]
    watch, _ = follow(drive, np.where(late, changed, y), model=model)
    assert group in watch.groups
    assert watch.change.groups[0] == group
