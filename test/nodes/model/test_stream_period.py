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

"""Neither a step of the clock nor a restart of the driver is another sample period."""

import numpy as np
import pytest

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.nodes.model.stream_period import StreamPeriod

PERIOD, EVERY = 2e-5, 1000
"""A device with memory, which sends every thousandth sample while it rests."""


def block(index, stamp, size=1, period=PERIOD):
    count = np.arange(size)
    values, numbers = np.zeros(size), ((index + count) % 2**32).astype(np.uint32)
    return SampleBlock(round(stamp * 1e9), period * count, values, values, numbers, numbers)


def single(numbers, shift=0.0, first=0, period=PERIOD):
    """Blocks of one sample; the clock is `shift` ahead."""
    return [block(first + EVERY * k, 100.0 + shift + EVERY * k * period) for k in numbers]


def periods(*blocks):
    """Periods that were found, in order, without those that were not."""
    stream = StreamPeriod()
    return [period for period in map(stream.of, blocks) if period is not None]


def test_single_samples_give_their_period_also_where_the_index_wraps():
    found = periods(*single(range(10), first=2**32 - 5 * EVERY))
    assert len(found) == 8
    assert found == pytest.approx([PERIOD] * 8)


@pytest.mark.parametrize("step", [0.5, -0.015, -0.5, 3600.0])
def test_a_step_of_the_clock_is_no_other_period(step):
    found = periods(*single(range(5)), *single(range(5, 10), step))
    assert len(found) > 4
    assert found == pytest.approx([PERIOD] * len(found))


@pytest.mark.parametrize("last", [170_000, 3_000_000_000])
def test_a_restart_of_the_driver_is_no_other_period(last):
    found = periods(*single(range(5), first=last), *single(range(5), 5.0))
    assert len(found) > 4
    assert found == pytest.approx([PERIOD] * len(found))


def test_a_driver_with_another_period_is_found():
    assert periods(*single(range(5)), *single(range(5), 5.0, period=3e-5))[-1] == pytest.approx(3e-5)
    assert periods(*single(range(5)), block(5 * EVERY, 200.0, 10, 3e-5))[-1] == pytest.approx(3e-5)
