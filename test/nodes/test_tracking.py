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

"""Errors along a path: each received sample counts once, and `status` says what limits the expected error."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.compensation import Limits, plan
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.identified_range import identified_range
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.parameter_covariance import ParameterCovariance
from piezo_hysteresis.nodes.compensation.tracking import Tracking
from piezo_hysteresis.nodes.compensation.trajectory import described
from piezo_hysteresis.record import Record

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


def test_the_node_says_what_limits_the_expected_error():
    """It said 5 nm of a path for which the terminal said that the model was identified up to a lower frequency."""
    period = 1e-4
    slow = Record(*2 * (4.0 - 4.0 * np.cos(2.0 * np.pi * 5.0 * period * np.arange(10_000)),), period)
    known = {"free_run_error": "5e-9", **identified_range((slow,), (0,))}
    model = Model((BoucWen(), Arx(a=[-0.5], b=[0.5])), period, 10.0, 4e-5, known)
    paths = [4e-6 - 2e-6 * np.cos(2.0 * np.pi * f * period * np.arange(4000)) for f in (5.0, 50.0)]
    inside, beyond = (described(plan(model, y, Limits(-1.0, 10.0), approach=0.2)) for y in paths)
    assert "identified up to" not in inside and "parameters" not in inside
    assert "the drive reaches 50 Hz, the model was identified up to 5 Hz; the error may be larger there" in beyond
    unsure = replace(model, covariance=ParameterCovariance.of(["bouc_wen.p2"], np.array([[1e-4]])))
    assert "nm, model 5.0 nm, its parameters " in described(plan(unsure, paths[0], Limits(-1.0, 10.0)))
