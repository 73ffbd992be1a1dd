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

"""Data of simulations with the explicit step of Eq. (7) are recognised, and the error of the step is subtracted."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import (
    Arx,
    AsymmetricHysteresis,
    BoucWen,
    HysteresisExponent,
    PublishedBoucWen,
)
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.training.explicit_step import KIND, explicit_model, step_changes, without_steps
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

LOOP = {"A": -0.7, "beta": 3.5, "gamma": 0.6, "p1": 0.05, "p2": 1.6}
DYNAMICS = Arx(a=(-0.9,), b=(0.1,), delay=2)
FAST, SLOW, NOISE = 2e-5, 2e-4, 1e-9
RANDOM = np.random.default_rng(4)


def model(kind):
    return Model((kind(**LOOP), DYNAMICS), FAST, 10.0, 1e-5)


def answered(kind):
    """Loops, noise and jumps, as the loop of a kind answers them."""
    triangle = 9.0 * (1.0 - np.abs(np.linspace(-1.0, 1.0, 2001)))
    drives = [(triangle, SLOW, "triangle"), (np.cumsum(RANDOM.normal(0.0, 0.05, 3000)) % 1.0, FAST, "noise")]
    drives += [(np.repeat([0.0, top, 0.5 * top], 400), FAST, "step") for top in (1.0, 3.0, 5.0)]
    records = [Record(u, np.zeros(u.size), period, phase) for u, period, phase in drives]
    answers = model(BoucWen).simulate(records[:1]) + model(kind).simulate(records[1:])
    return tuple(
        replace(r, displacement=y + RANDOM.normal(0.0, NOISE, r.size)) for r, y in zip(records, answers, strict=True)
    )


def training_data(records):
    floors = np.full(len(records), 3.0 * NOISE)
    return TrainingData(
        records, floors, Extent.of(records, model(BoucWen).voltage_scale, model(BoucWen).displacement_scale)
    )


@pytest.mark.parametrize("height", [0.01, 0.1, 0.4])
def test_a_jump_from_rest_agrees_with_the_closed_solution(height):
    static = Model((BoucWen(**LOOP), Arx(a=(), b=(1.0,), delay=1)), FAST, 10.0, 1e-5)
    jump = Record(10.0 * np.repeat([0.0, height], 10), np.zeros(20), FAST)
    (change,) = step_changes(static, [jump])
    loss = LOOP["beta"] - LOOP["gamma"]  # h, driven by a negative A, has the other sign than the drive
    exact = LOOP["A"] / loss * (1.0 - np.exp(-loss * height))
    assert change[:10] == pytest.approx(0.0)
    assert change[-1] == pytest.approx(1e-5 * (LOOP["A"] * height - exact), rel=1e-9)


def test_slow_records_have_no_error_of_the_explicit_step():
    records = answered(BoucWen)
    assert not step_changes(model(BoucWen), records)[0].any()


def test_data_of_an_explicit_step_are_recognised():
    assert explicit_model(model(BoucWen), training_data(answered(PublishedBoucWen))) is not None
    assert explicit_model(model(BoucWen), training_data(answered(BoucWen))) is None


def test_after_the_subtraction_the_exact_loop_remains():
    freed = without_steps(Experiment(answered(PublishedBoucWen)), model(BoucWen))
    assert [n.kind for n in freed.notices] == [KIND]
    for record, expected in zip(freed, model(BoucWen).simulate(list(freed)), strict=True):
        assert np.std(record.displacement - expected) < 1.1 * NOISE


def test_the_changes_include_every_term_of_the_loop():
    terms = (HysteresisExponent(n=1.6), AsymmetricHysteresis(phi1=0.5, phi2=-0.4))
    loop = Model((BoucWen(**LOOP), *terms, Arx(a=(), b=(1.0,), delay=1)), FAST, 10.0, 1e-5)
    jump = Record(10.0 * np.repeat([0.0, 0.05, 0.02], 4), np.zeros(12), FAST)
    (change,) = step_changes(loop, [jump])
    first = LOOP["A"] * 0.05  # from h = 0 no loss
    power = (abs(first) / 0.2) ** 0.6
    loss = power * (LOOP["beta"] * 0.03 * first - LOOP["gamma"] * 0.03 * abs(first))
    second = first - LOOP["A"] * 0.03 - loss - 0.5 * 0.03 * first - 0.4 * 0.03 * abs(first)
    exact = loop.simulate([jump])[0]
    expected = 1e-5 * (second + LOOP["p1"] * 0.02**3 + LOOP["p2"] * 0.02)
    assert exact[-1] + change[-1] == pytest.approx(expected, rel=1e-9)
