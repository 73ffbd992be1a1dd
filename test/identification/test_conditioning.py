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

"""A record that only determines the state of the next one may be much shorter, and leaves the stage in this state."""

import numpy as np
import pytest

from piezo_hysteresis.effects import MEMORY, Arx, Backlash, BoucWen, Creep
from piezo_hysteresis.identification.fit.form_uncertainty import ADEQUACY
from piezo_hysteresis.identification.records.conditioning import path_of
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 2e-5
STAGE = Model((BoucWen(), Arx(a=(-0.9,), b=(0.1,), delay=1.0)), PERIOD, 10.0, 2e-5)
PLAYS = MEMORY(c=(0.03, 0.03, 0.03, 0.02, 0.02, 0.01, 0.0, 0.0), reach=0.5)


def noise(size, seed):
    """Noise of a few hundred hertz around the middle of the range, from 0 V and back to it."""
    rng = np.random.default_rng(seed)
    wave = np.convolve(rng.normal(size=size + 400), np.hanning(401) / np.hanning(401).sum(), "valid")
    shape = np.minimum(1.0, np.minimum(np.arange(size), np.arange(size)[::-1]) / 4000)
    return shape * np.clip(4.0 + 1.5 * wave / wave.std(), 0.0, 8.0)


def then_a_triangle(drive):
    """The record with this drive, and a slower one that continues it."""
    first = Record(drive, drive, PERIOD)
    loops = 2.0 * np.abs((np.arange(4000) / 1000 + 1.0) % 2.0 - 1.0)
    return first, Record(loops, loops, 1e-3, start_time=first.duration, continues=True)


@pytest.mark.parametrize("effect", [Creep(gamma=0.015), Backlash(b=0.05), PLAYS], ids=["creep", "backlash", "plays"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_next_record_is_the_same_behind_a_path(effect, seed):
    """Far below the error that counts as perfect: the model that is fitted behind it is the same."""
    model = STAGE.with_effect(effect)
    first, second = then_a_triangle(noise(60_000, seed))
    path = path_of(first, 6000)
    assert sum(r.size for r in path) < 9000
    assert path[0].duration + path[1].duration == pytest.approx(first.duration)
    whole, behind = model.simulate((first, second))[1], model.simulate((*path, second))[-1]
    assert np.sqrt(np.mean((whole - behind) ** 2)) < 0.02 * ADEQUACY * np.ptp(whole)


def test_a_path_goes_to_every_extreme_and_ends_like_the_record():
    first, _ = then_a_triangle(noise(60_000, 5))
    coarse, end = path_of(first, 6000)
    assert (coarse.voltage.min(), coarse.voltage.max()) == (first.voltage.min(), first.voltage.max())
    assert np.array_equal(end.voltage, first.voltage[-end.size :])
    assert end.continues and end.sample_period == PERIOD


def test_a_short_record_stays():
    first, _ = then_a_triangle(noise(11_000, 1))
    assert path_of(first, 6000) == (first,)
