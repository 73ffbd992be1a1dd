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

"""What counts as an effect once it has been fitted."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.search import acceptance_tests
from piezo_hysteresis.discrepancy.search.acceptance_tests import (
    first_rejection,
    is_steady,
)
from piezo_hysteresis.discrepancy.search.candidate_refits import bends_all_along, simplest
from piezo_hysteresis.discrepancy.search.candidates import FittedCandidate
from piezo_hysteresis.effects import (
    AmplifierSaturation,
    Backlash,
    BoucWen,
    Creep,
    CreepFractional,
    GainDrift,
    MainsHum,
)
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.fit.normal_equations import Linearised
from piezo_hysteresis.identification.training.model_score import Fitted
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

EXTENT = Extent(0.0, 10.0, 1e3, 10.0, 1e-5, 2e-5, 100.0, 10.0, 10.0)


def fitted(effect, names, covariance, null=1.0):
    model = Model((BoucWen(A=0.5, beta=3.0, gamma=0.5, p1=0.0, p2=1.0), effect), 2e-5, 10.0, 1e-5)
    result = Fit(model, names, np.asarray(covariance), 1.0, (), (), (), True, 3)
    training_data = TrainingData((), np.ones(1), EXTENT, noise=np.full(1, np.sqrt(null)))
    return FittedCandidate(effect, training_data, Score(np.ones(3), np.zeros(len(names))), result)


def scored(*ratios):
    return Score(np.array(ratios), np.zeros(2))


@pytest.mark.parametrize(
    ("before", "alone", "reason"),
    [
        ((1.05, 1.05), (9.0, 9.0), "lowers mean ln R² by 0.09, and a decrease by 0.15 is needed"),
        ((1.077, 1.077), (9.0, 9.0), "lowers mean ln R² by 0.14, and a decrease by 0.15 is needed"),
        ((1.0, 1.0), (9.0, 9.0), "lowers mean ln R² by 0.00, and"),
        ((1.0, 1.9), (9.0, 9.0), None),
        ((9.0, 9.0), (1.0, 1.0), "gains 0.00 over the model that was refitted without it, and"),
        ((9.0, 9.0), (1.077, 1.077), "gains 0.14 over the model that was refitted without it, and 0.15"),
        ((9.0, 9.0), (9.0, 9.0), None),
        ((9.0, 9.0), None, None),
    ],
    ids=[
        "little gain",
        "almost enough gain",
        "no gain",
        "enough gain",
        "gain of the refit alone",
        "almost the gain of the effect",
        "gain of the effect",
        "nothing to compare with",
    ],
)
def test_an_effect_must_gain_also_over_the_model_that_was_refitted_without_it(monkeypatch, before, alone, reason):
    drift = fitted(GainDrift(g=0.05, tau=600.0), ("gain_drift.g", "gain_drift.tau"), np.eye(2), null=0.5)
    refitted = alone and Fitted(drift.fit.model, scored(*alone), Linearised((), ()))
    monkeypatch.setattr(acceptance_tests, "without", lambda candidate: refitted)
    rejection = first_rejection(replace(drift, score=scored(1.0, 1.0)), scored(*before))
    assert rejection is None if reason is None else reason in rejection


@pytest.mark.parametrize(
    ("size", "tau", "certain"),
    [(2e-3, 1.0, True), (-2e-3, 1.0, True), (5e-5, 1.0, False), (0.1, 100.0, True), (2.5e-3, 100.0, False)],
)
def test_an_effect_at_the_floor_must_be_larger_than_the_uncertainty_of_the_form(monkeypatch, size, tau, certain):
    """Creep of 0.07 % was named beside a rate law whose form left an error of this size.

    Of a drift that is slower than the data, only the quotient of size and time constant is known, which is enough.
    """
    drift = fitted(GainDrift(g=size, tau=tau), ("gain_drift.g", "gain_drift.tau"), np.zeros((2, 2)))
    drive = 5.0 - 5.0 * np.cos(np.linspace(0.0, 20.0 * np.pi, 2000))
    record = Record(drive, drift.fit.model.simulate(Record(drive, np.zeros(2000), 1e-3))[0], 1e-3)
    data = replace(drift.training_data, records=(record,), noise=None, floors=np.array([1e-9]))
    monkeypatch.setattr(acceptance_tests, "without", lambda candidate: None)
    found = replace(drift, training_data=data, score=scored(1.0, 1.0))
    assert (first_rejection(found, scored(1.2, 1.2)) is None) == certain
    assert first_rejection(found, scored(2.0, 2.0)) is None


@pytest.mark.parametrize(
    ("amplitudes", "floors", "steady"),
    [
        ((9.0, 11.0, 10.0, 10.0, 12.0), (1.0,) * 5, True),
        ((0.9, 1.1, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 0.1, 0.1), True),
        ((0.2, 0.3, 0.2, 1.2, 58.0), (1.0,) * 5, False),
        ((0.2, 0.3, 9.0, 7.0, 0.2), (1.0,) * 5, False),
        ((5e-3, 7e-3, 0.6, 29.0, 40.0, 4.4, 6.0), (1.0,) * 7, False),
        ((0.2, 0.2, 60.0), (1.0,) * 3, True),
    ],
    ids=["mains", "noisy fast records", "one drive", "two drives", "fast drives", "too few records"],
)
def test_hum_has_the_same_amplitude_whatever_the_drive_does(amplitudes, floors, steady):
    """Beside the mains frequency, its harmonics are free; records in phase with the drive must not decide.

    Beside a rate law of another form, hum was named from sines of 50 and 150 Hz. In noisy fast records, it gains little
    without depending on the drive.
    """
    hum = fitted(MainsHum(), (), np.empty((0, 0)))
    record = Record(np.zeros(1000), np.zeros(1000), 1e-3)
    data = TrainingData((record,) * len(amplitudes), np.array(floors), EXTENT)
    free = tuple(np.array([0.0, a, 0.0, 0.1, 0.0, 0.1, 0.0]) for a in amplitudes)
    hum = replace(hum, training_data=data, fit=replace(hum.fit, nuisances=free), score=scored(*np.ones(len(floors))))
    before = np.sqrt(1.0 + 0.5 * (np.square(amplitudes) + 0.02) / np.square(floors))
    assert is_steady(hum, scored(*before)) is steady


@pytest.mark.parametrize(("size", "period"), [(30, 1e-3), (1000, 1e-2)], ids=["short", "averaged"])
def test_records_that_are_too_short_or_too_slow_for_hum_do_not_deny_it(size, period):
    shows, hides = (Record(np.zeros(n), np.zeros(n), t) for n, t in ((1000, 1e-3), (size, period)))
    amplitudes = np.array([10.0] * 5 + [0.0] * 5)
    hum = fitted(MainsHum(), (), np.empty((0, 0)))
    free = tuple(np.array([0.0, a, 0.0, 0.0, 0.0, 0.0, 0.0]) for a in amplitudes)
    data = TrainingData((shows,) * 5 + (hides,) * 5, np.ones(10), EXTENT)
    hum = replace(hum, training_data=data, fit=replace(hum.fit, nuisances=free), score=scored(*np.ones(10)))
    assert is_steady(hum, scored(*np.sqrt(1.0 + 0.5 * amplitudes**2)))


@pytest.mark.parametrize("noise", [0.0, 4e-3])
@pytest.mark.parametrize(
    ("effect", "small"),
    [
        (Backlash(b=2e-3), True),
        (Backlash(b=5e-2), False),
        (AmplifierSaturation(lower=3e-3), True),
        (AmplifierSaturation(upper=7.0), False),
    ],
    ids=["narrow", "wide", "at 0 V", "at 7 V"],
)
def test_what_only_keeps_the_noise_of_a_measured_voltage_from_the_model_is_no_effect(monkeypatch, noise, effect, small):
    """Beside creep, a backlash of 1.9 mV was named, and a limit at 2.3 mV of a stage without effects."""
    monkeypatch.setattr(acceptance_tests, "without", lambda candidate: None)
    drive = np.maximum(0.0, 8.0 * np.sin(np.linspace(0.0, 20.0, 2000)))
    record = Record(drive + noise * np.random.default_rng(0).normal(size=2000), drive, 1e-3, voltage_noise=noise)
    found = fitted(effect, (), np.empty((0, 0)))
    found = replace(found, training_data=replace(found.training_data, records=(record,)), score=scored(1.0, 1.0))
    rejection = first_rejection(found, scored(9.0, 9.0))
    assert (rejection is not None and "noise" in rejection) if small and noise else rejection is None


@pytest.mark.parametrize("gamma", [0.002, -0.002])
@pytest.mark.parametrize("law", [Creep(), CreepFractional(exponent=0.5)], ids=["logarithmic", "fractional"])
def test_creep_that_goes_back_is_not_named(monkeypatch, law, gamma):
    """Large plays beside the loop were named creep, with γ = -0.001 and the largest exponent."""
    monkeypatch.setattr(acceptance_tests, "without", lambda candidate: None)
    found = replace(fitted(law.with_values(gamma=gamma), (), np.empty((0, 0))), score=scored(1.0, 1.0))
    assert ("negative" in str(first_rejection(found, scored(9.0, 9.0)))) is (gamma < 0.0)


@pytest.mark.parametrize(("corner", "curve"), [(0.1, False), (4.0, False), (30.0, True)])
def test_a_limit_whose_bend_is_wider_than_the_drive_is_a_curve(corner, curve):
    saturation = AmplifierSaturation(upper=9.0, corner=corner)
    assert bends_all_along(fitted(saturation, (), np.empty((0, 0)))) is curve


@pytest.mark.parametrize(
    ("simple", "others", "law"),
    [(1.15, 1.0, "creep"), (1.15, 1.15, "creep_fractional"), (5.0, 1.0, "creep_fractional")],
    ids=["one record", "all records", "above the floor"],
)
def test_a_law_with_one_number_more_must_gain_visibly_over_one_that_reaches_the_floor(simple, others, law):
    names = ("creep_fractional.gamma", "creep_fractional.exponent")
    best = fitted(CreepFractional(gamma=0.01, exponent=0.05), names, np.eye(2))
    best = replace(best, score=Score(np.ones(10), np.zeros(2)))
    simpler = fitted(Creep(gamma=0.01), ("creep.gamma",), np.eye(1))
    simpler = replace(simpler, score=Score(np.array([simple, *[others] * 9]), np.zeros(1)))
    assert simplest([best, simpler]).name == law


@pytest.mark.parametrize(("error", "effect"), [(1.004, "gain_drift"), (1.03, "creep_fractional")], ids=["tie", "lead"])
def test_of_two_effects_that_differ_by_chance_the_one_with_fewer_numbers_is_taken(error, effect):
    names = ("creep_fractional.gamma", "creep_fractional.exponent")
    best = replace(fitted(CreepFractional(gamma=0.01, exponent=0.05), names, np.eye(2)), score=scored(1.0, 1.0))
    other = replace(fitted(GainDrift(g=0.05, tau=600.0), ("gain_drift.g",), np.eye(1)), score=scored(error, error))
    assert simplest([best, other]).name == effect
