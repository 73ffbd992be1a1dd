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

"""Honest drives are not taken for defects of their channel."""

import numpy as np
import pytest

from piezo_hysteresis.record import Record
from piezo_hysteresis.recording.checks.channel_defects import channel_defects

PERIOD = 1e-4


def kinds(drive):
    displacement = 1.5e-6 * drive + 5e-9 * np.random.default_rng(0).normal(size=drive.size)
    return {notice.kind for notice in channel_defects(Record(drive, displacement, PERIOD, "steps"))}


@pytest.mark.parametrize("samples", [8, 12, 50])
def test_ramps_of_few_samples_are_not_quantised_but_rounded_ones_are(samples):
    edge = np.linspace(0.0, 9.0, samples, endpoint=False)
    other = np.linspace(1.0, 6.0, samples + 5, endpoint=False)
    trapezoids = np.tile(np.concatenate((edge, np.full(99, 9.0), edge[::-1], other, other[::-1])), 20)
    assert "quantisation" not in kinds(trapezoids)
    slow = np.interp(np.arange(20_000), np.arange(trapezoids.size) * (20_000 / trapezoids.size), trapezoids)
    assert "quantisation" in kinds(np.round(slow / 0.25) * 0.25)


SLOW = 5.0 - 4.0 * np.cos(2.0 * np.pi * 2.0 * PERIOD * np.arange(10_000))


def dropouts(drive, applied):
    """Messages about drop-outs where the stage is driven by `applied`; a pulse makes it ring at 300 Hz."""
    k = np.arange(500)
    response = np.exp(-k / 100.0) * np.sin(2.0 * np.pi * 300.0 * PERIOD * k)
    displacement = 1.5e-6 * np.convolve(applied - applied[0], response / response.sum())[: applied.size]
    displacement += 5e-9 * np.random.default_rng(0).normal(size=applied.size)
    return [n.message for n in channel_defects(Record(drive, displacement, PERIOD, "sine")) if n.kind == "dropout"]


@pytest.mark.parametrize("samples", [1, 5])
def test_a_voltage_that_drops_out_alone_is_reported_and_a_real_pulse_is_not(samples):
    pulsed = SLOW.copy()
    pulsed[6000 : 6000 + samples] = 0.0
    (message,) = dropouts(pulsed, SLOW)
    assert message.startswith(f"the voltage drops out 1 times, {samples} samples")
    assert not dropouts(pulsed, pulsed)
    assert not dropouts(SLOW, SLOW)
