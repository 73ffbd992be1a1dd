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

"""Errors along a path: each received sample of the path counts once."""

from types import SimpleNamespace

import numpy as np
import pytest

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.nodes.compensation.tracking import Tracking

FIRST = 2**32 - 700
"""Index of the first sample of the drive; it wraps on the way."""


def block(begin, displacement):
    """Samples from drive sample `begin` on."""
    count = displacement.size
    index = ((FIRST + begin + np.arange(count)) % 2**32).astype(np.uint32)
    return SampleBlock(0, 1e-4 * np.arange(count), displacement, displacement, index, index)


@pytest.mark.parametrize("seed", range(5))
def test_every_received_sample_of_the_path_counts_once(seed):
    rng = np.random.default_rng(seed)
    begin, wanted = int(rng.integers(0, 300)), rng.normal(size=1000)
    drive = np.zeros(begin + wanted.size + int(rng.integers(0, 200)))
    tracking = Tracking(SimpleNamespace(voltage=drive, wanted=wanted, predicted=drive, begin=begin))
    measured = rng.normal(size=drive.size + 400)  # from 200 samples before the drive on
    received = np.zeros(measured.size, dtype=bool)
    ends = [0, *np.sort(rng.integers(0, measured.size, 20)), measured.size]
    for number, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
        if number == 5:
            tracking.begin(FIRST)
        if b > a and rng.random() < 0.8:
            received[a:b] = True
            for _ in range(int(rng.integers(1, 3))):
                tracking.take(block(a - 200, measured[a:b]))
    path = slice(200 + begin, 200 + begin + wanted.size)
    errors = (wanted - measured[path])[received[path]]
    assert tracking.rms == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-12)
    assert tracking.newest_error == pytest.approx(errors[-1], rel=1e-12)
