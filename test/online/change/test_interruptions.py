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

"""The change watch of a stream that is interrupted: restarts, another sample period, a late rest, lost samples."""

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.change.baseline import Baseline
from piezo_hysteresis.online.change.watch import ChangeWatch
from piezo_hysteresis.online.predictor import Predictor

PERIOD = 2e-3
MODEL = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,))), PERIOD, displacement_scale=1e-5)
NOISE = 2e-9


class Stream:
    """A stage that follows its model, seen by a watch; `zero` is that of its sensor, `gain` that of its motion."""

    def __init__(self, model=MODEL, period=PERIOD, seed=0):
        self.model, self.rng = model, np.random.default_rng(seed)
        self.watch = ChangeWatch(86400.0)
        self.stamp, self.zero, self.gain, self.seen, self.largest = 0, 0.0, 1.0, [], 0.0
        self.begin(period)

    def begin(self, period):
        """A driver with another sample period."""
        self.chain, self.predictor = self.model.at(period), Predictor(period, self.model)
        self.restart()

    def restart(self):
        """The driver ends, and begins again after 3 s."""
        self.index, self.state = 0, self.chain.rest(3.5)
        self.stamp += 3_000_000_000

    def play(self, seconds, rest=0.0, lost=False):
        """Hold 3.5 V, and then follow a sine of 11 Hz."""
        period = self.predictor.sample_period
        time, size = period * np.arange(round(seconds / period)), round(0.1 / period)
        drive = 3.5 + 2.5 * np.sin(2 * np.pi * 11.0 * np.maximum(time - rest, 0.0))
        for first in range(0, time.size, size):
            u = drive[first : first + size]
            y, self.state = self.chain.run(u, self.state)
            y = self.zero + self.gain * y + NOISE * self.rng.standard_normal(u.size)
            if not lost:
                answer = self.predictor.predict(self.index, self.stamp, u, y, settled=self.index == 0)
                self.watch.add(u, answer, self.predictor, self.stamp + round(u.size * period * 1e9))
                self.seen.append((self.watch.blind, self.watch.since))
                self.largest = max(self.largest, self.watch.change.statistic)
            self.index, self.stamp = self.index + u.size, self.stamp + round(u.size * period * 1e9)


def with_baseline(**given):
    stream = Stream(**given)
    stream.watch.take_baseline(20.0)
    stream.play(24.0, rest=0.2)
    assert not stream.watch.blind
    return stream


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.soak), pytest.param(2, marks=pytest.mark.soak)])
@pytest.mark.parametrize("zero", [0.0, 3e-6])
def test_a_restart_of_the_driver_is_no_change(seed, zero):
    stream = with_baseline(seed=seed)
    stream.zero = zero
    stream.restart()
    stream.play(15.0, rest=0.2)
    assert stream.watch.alarms == 0
    assert 0.05 < stream.largest < 1.0


@pytest.mark.parametrize("seed", [0, 1])
def test_the_first_rest_of_a_stream_that_was_joined_in_motion_is_no_change(seed):
    """There the predictor measures its offset again."""
    stream = Stream(seed=seed)
    stream.index = 1000
    stream.play(6.0)
    stream.watch.take_baseline(20.0)
    stream.play(24.0)
    stream.play(15.0, rest=5.0)
    assert stream.watch.alarms == 0
    assert stream.watch.change.groups


@pytest.mark.parametrize("periods", [(2e-4, 2e-3), (2e-3, 2e-4)])
def test_a_baseline_of_another_sample_period_is_not_used(periods, tmp_path):
    model = Model((BoucWen(), Arx(a=(-0.6,), b=(0.2,))), 2e-4, displacement_scale=1e-5)
    stream = with_baseline(model=model, period=periods[0])
    stream.watch.baseline.save(tmp_path / "baseline.npz")
    stream.begin(periods[1])
    stream.play(8.0, rest=0.2)
    reason = f"taken at {periods[0]:g} s per sample, and the stream has {periods[1]:g} s"
    assert reason in stream.watch.blind
    stream.watch = ChangeWatch(86400.0, Baseline.load(tmp_path / "baseline.npz"))
    stream.play(20.0)
    assert stream.watch.alarms == 0
    assert reason in stream.watch.blind
    stream.begin(periods[0])
    stream.play(8.0, rest=0.2)
    assert not stream.watch.blind


def test_an_alarm_remains_while_lost_samples_blind_the_watch():
    stream = with_baseline()
    stream.gain = 1.01
    stream.play(4.0)
    onset = stream.watch.since
    assert onset
    stream.play(1.0, lost=True)
    stream.seen = []
    stream.play(10.0)
    assert {since for _, since in stream.seen} == {onset}
    assert len({blind for blind, _ in stream.seen}) == 3  # warming up, measuring the zero, and comparing
    assert not stream.watch.blind
    assert stream.watch.alarms == 1


def test_a_baseline_holds_one_zero_of_the_sensor():
    stream = Stream()
    stream.watch.take_baseline(20.0)
    stream.play(15.0, rest=0.2)
    stream.zero = 1e-7
    stream.predictor.zero()
    stream.play(15.0)
    assert stream.watch.is_taking
    stream.play(8.0)
    (scatter,) = (s for s in stream.watch.baseline.scatter.values() if s.count > 150)
    assert scatter.power < 2.0 * NOISE**2


def test_lost_samples_of_a_periodic_drive_are_no_change():
    """A sine of 5 Hz, of which every score covers half a cycle, and a model that misses harmonics of 12 nm.

    After lost samples the scores began at another phase than those of the baseline, which led to an alarm.
    """
    rng, watch, predictor = np.random.default_rng(3), ChangeWatch(86400.0), Predictor(PERIOD, MODEL)
    phase = 2.0 * np.pi * 5.0 * PERIOD * np.arange(40_000)
    drive = 3.5 + 2.5 * np.sin(np.maximum(phase - np.pi, 0.0))
    moved, _ = MODEL.run(drive, MODEL.rest(3.5))
    missed = 12e-9 * (np.sin(2.0 * phase + 0.7) + np.cos(3.0 * phase) + np.abs(np.sin(phase + 0.4)))
    measured = moved + missed + NOISE * rng.standard_normal(drive.size)
    watch.take_baseline(30.0)
    for first in range(0, drive.size, 10):
        if first > 18_000 and first % 4000 < 10 * (first // 4000):
            continue
        part, stamp = slice(first, first + 10), round(first * PERIOD * 1e9)
        answer = predictor.predict(first, stamp, drive[part], measured[part], settled=first == 0)
        watch.add(drive[part], answer, predictor, stamp + round(10 * PERIOD * 1e9))
    assert watch.baseline is not None and not watch.blind
    assert watch.alarms == 0
