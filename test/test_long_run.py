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

"""A day of samples, a thousand million of them, and numbers at the end of float64: nothing drifts, nothing grows."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piezo_hysteresis
from piezo_hysteresis.acquisition.time_base import TimeBase
from piezo_hysteresis.effects import Arx, BoucWen, MainsHum, ThermalDrift
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.online.sequence_check import SequenceCheck

DAY = 86_400.0
OWN = tracemalloc.Filter(True, str(Path(piezo_hysteresis.__file__).parent / "*"))
"""Memory that this package holds; other threads of the test process take and free memory of their own."""
EFFECTS = (
    BoucWen(),
    Arx(a=[-0.5], b=[0.5]),
    ThermalDrift(D=2e-7, tau=20_000.0),
    MainsHum(f=50.0, cosine=[1e-8, 2e-9], sine=[0.0, 3e-9]),
)


def drive(first: int, count: int, period: float) -> np.ndarray:
    """Loops of 20 s from 0 to 7 V, sample by sample the same however they are cut [V]."""
    cycle = round(20.0 / period)
    return 3.5 - 3.5 * np.cos(2 * np.pi * ((first + np.arange(count)) % cycle) / cycle)


@pytest.mark.parametrize("period", [0.05, pytest.param(8e-4, marks=pytest.mark.soak)])
def test_a_day_in_blocks_is_an_exact_restart_a_little_before_its_end(period):
    """Loops forget where they came from, and time is counted in samples: 10⁸ of them with the shorter period."""
    model = Model(EFFECTS, period)
    count, size, last = round(DAY / period), 5000, round(400.0 / period)
    state = model.rest(0.0)
    kept = []
    for first in range(0, count, size):
        y, state = model.run(drive(first, size, period), state)
        if first >= count - last:
            kept.append(y)
    stream = np.concatenate(kept)
    begin = count // size * size + (size if count % size else 0) - stream.size
    fresh, _ = model.run(drive(begin, stream.size, period), model.rest(0.0, begin * period))
    half = stream.size // 2
    np.testing.assert_allclose(stream[half:], fresh[half:], rtol=0, atol=1e-12 * np.ptp(stream))


@pytest.mark.parametrize("period", [0.1, pytest.param(0.01, marks=pytest.mark.soak)])
def test_a_day_of_predictions_is_exact_and_memory_stays_flat(period):
    """Also where the index wraps."""
    size, first = 1000, 2**32 - 300_000
    model = Model(EFFECTS[:2], period)
    predictor, state = Predictor(period, model), model.rest(0.0)
    tracemalloc.start()
    try:
        worst, sizes = 0.0, []
        for block in range(round(DAY / period) // size):
            voltage = drive(block * size, size, period)
            measured, state = model.run(voltage, state)
            answer = predictor.predict(
                (first + block * size) % 2**32, round(block * size * period * 1e9), voltage, measured
            )
            worst = max(worst, float(np.abs(answer.residual).max()))
            if block % 100 == 99:
                held = tracemalloc.take_snapshot().filter_traces([OWN])
                sizes.append(sum(trace.size for trace in held.traces))
    finally:
        tracemalloc.stop()
    assert worst < 1e-15
    assert predictor.sequence.received == round(DAY / period) // size * size
    assert predictor.sequence.lost == 0
    half = len(sizes) // 2  # by then the history of the drive is as long as it gets
    assert max(sizes[half:]) < 1.05 * max(sizes[:half])


@given(st.integers(10**9, 2**38), st.integers(1, 5000), st.integers(0, 10**6))
def test_a_thousand_million_samples_are_counted_to_the_last(count, size, lost):
    sequence, clock = SequenceCheck(2e-5), TimeBase(2e-5)
    clock.anchor(0, 0.0, 0)
    for first in (count, count + size + lost):
        arrival = sequence.join(first % 2**32, clock.stamp(first), size)
    assert (arrival.missing, arrival.repeated, arrival.restarted) == (lost, 0, False)
    assert clock.stamp(count + 1) - clock.stamp(count) == pytest.approx(20_000, abs=2)


@pytest.mark.parametrize("level", [5e-324, 1e-310, 1e-300, -5e-324])
def test_denormal_voltages_are_as_good_as_none(level):
    model = Model(EFFECTS[:2], 1e-3)
    voltage = level * np.random.default_rng(1).integers(0, 3, 2000)
    y, _ = model.run(voltage, model.rest(0.0))
    assert np.abs(y).max() < 1e-290
