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

"""Refits of candidates from other starts."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from piezo_hysteresis.discrepancy.search.candidates import Candidate
from piezo_hysteresis.discrepancy.search.refit import proceed, refit, restart, without
from piezo_hysteresis.effects import (
    HYSTERESIS,
    AmplifierBandwidth,
    AmplifierSlewLimit,
    Arx,
    MainsHum,
    Offset,
    Softening,
)
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.records.noise_floor import ADEQUATE
from piezo_hysteresis.identification.training.model_score import score_model
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD, NOISE = 1e-4, 1e-9
STAGE = Model(
    (HYSTERESIS(A=-0.24, beta=4.9, gamma=-2.0, p2=1.0), Arx(a=(-1.6, 0.7), b=(0.1,)), Offset()), PERIOD, 10.0, 1e-5
)
SLEW_LIMIT = AmplifierSlewLimit(S=2000.0)
NARROW = HYSTERESIS(A=-0.1, beta=5000.0, gamma=4999.0, p2=1.0)
"""A loop with a width of almost zero, as fits without the slew limit find it."""


def measured():
    rng, time = np.random.default_rng(0), PERIOD * np.arange(6000)
    drives = [5.0 * (1.0 - np.cos(2.0 * np.pi * f * time)) for f in (2.0, 5.0, 10.0)]
    drives += [np.concatenate(([0.0] * 50, np.repeat(rng.uniform(0.0, 10.0, 119), 50))) for _ in range(2)]
    records = [Record(u, np.zeros(u.size), PERIOD, initial_voltage=0.0) for u in drives]
    moved = STAGE.with_effect(SLEW_LIMIT).simulate(records)
    return tuple(
        replace(r, displacement=y + NOISE * rng.normal(size=y.size)) for r, y in zip(records, moved, strict=True)
    )


def test_a_loop_that_lost_its_width_is_started_again():
    records = measured()
    extent = Extent.of(records, STAGE.voltage_scale, STAGE.displacement_scale)
    data = TrainingData(records, np.full(len(records), NOISE), extent, start=STAGE)
    bent = STAGE.with_hysteresis(NARROW)
    found = refit(bent, Candidate(SLEW_LIMIT, data, score_model(bent, data)), 9)
    assert found is not None
    assert proceed(found).score.excess > 10.0 * ADEQUATE
    assert restart(found, 9).score.excess < ADEQUATE


def test_dynamics_are_estimated_anew_without_the_hum_of_the_recordings():
    """Hum, which the model has behind the dynamics, was taken for motion of the stage: V was 248."""
    rng, hum = np.random.default_rng(1), MainsHum(f=50.0)
    drives = [5.0 + scipy.ndimage.gaussian_filter1d(rng.normal(0.0, 5.0, 6000), 3) for _ in range(3)]
    at = PERIOD * np.arange(6000)
    records = tuple(
        Record(u, y + 5e-7 * np.cos(2.0 * np.pi * 50.0 * at + phase) + NOISE * rng.normal(size=u.size), PERIOD)
        for phase, (u, y) in enumerate((u, STAGE.simulate([Record(u, u, PERIOD)])[0]) for u in drives)
    )
    data = TrainingData(records, np.full(len(records), NOISE), Extent.of(records, 10.0, 1e-5), start=None)
    other = STAGE.with_effect(Arx(a=(-1.2, 0.4), b=(0.2,)))
    begun = refit(other, Candidate(hum, data, score_model(other.with_effect(hum), data)), 1)
    assert begun is not None
    assert begun.score.excess > 10.0
    assert restart(begun, 1).score.excess < 1.1


def test_a_model_that_diverges_without_a_lag_is_not_compared_with():
    """Such a model, whose mode softens, ended the diagnosis with a DivergenceError."""
    rng, pole = np.random.default_rng(0), AmplifierBandwidth(tau=5e-3)
    fast = STAGE.with_effect(Arx(a=(-1.58, 0.79), b=(0.21,))).with_effect(Softening(k3=-0.2))
    slow = fast.with_effect(pole)
    drives = [np.repeat(rng.uniform(0.0, 10.0, 120), 50) for _ in range(2)]
    records = [Record(u, u, PERIOD, initial_voltage=0.0) for u in drives]
    records = [replace(r, displacement=y) for r, y in zip(records, slow.simulate(records), strict=True)]
    with pytest.raises(DivergenceError):
        fast.free_run(records)
    data = TrainingData(tuple(records), np.full(2, NOISE), Extent.of(records, 10.0, 1e-5))
    assert data.broadband
    found = refit(fast, Candidate(pole, data, score_model(slow, data)), 1)
    assert found is not None
    with np.errstate(over="ignore", invalid="ignore"):  # as in `diagnose`
        assert without(found) is None
