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

"""Intervals that do not shrink with the length of a record: closed form for one gain, and a stage of other form."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import AmplifierBandwidth, AmplifierSlewLimit, Arx, BoucWen, Creep, Offset
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.identification.fit.form_uncertainty import (
    ADEQUACY,
    PIECES,
    slope_spread,
    with_alternative,
    with_form_uncertainty,
)
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.stage.plant import Plant, PlantParameters

MODEL = Model((BoucWen(A=0.0, p1=0.0, p2=1.0), Arx(a=(), b=(1.0,), delay=1), Offset()), 1e-3, 1.0, 1e-5)
SPAN = 2e-5


def errors_of(size, misfit=0.0):
    """Standard errors of p2 without and with the form, from a sine with white noise and a slow misfit."""
    rng = np.random.default_rng(3)
    u = np.sin(2 * np.pi * 5 * np.arange(size) / size)
    (y,) = MODEL.simulate(Record(u, np.zeros(size), 1e-3))
    noise = 1e-9
    slow = misfit * np.sqrt(2.0) * np.cos(2 * np.pi * 3 * np.arange(size) / size)
    record = Record(u, y + noise * rng.normal(size=size) + slow, 1e-3)
    found = fit(MODEL, (record,), ["bouc_wen.p2"], floors=[noise])
    wider = with_form_uncertainty(found, (record,), Nuisance(), [noise], [noise], SPAN)
    return found.standard_errors["bouc_wen.p2"], wider.standard_errors["bouc_wen.p2"]


@pytest.mark.parametrize("size", [1_000, 100_000])
def test_the_form_uncertainty_does_not_depend_on_the_length_of_the_record(size):
    """p2 moves y by a sine of amplitude 1e-5 m: δ/√PIECES over its rms."""
    alone, wider = errors_of(size)
    expected = ADEQUACY * SPAN / np.sqrt(PIECES) / (1e-5 / np.sqrt(2.0))
    assert np.sqrt(wider**2 - alone**2) == pytest.approx(expected, rel=0.05)


def test_an_effect_that_may_be_there_moves_the_ends_of_the_intervals():
    rng, u = np.random.default_rng(3), np.sin(2 * np.pi * 5 * np.arange(1000) / 1000)
    (y,) = MODEL.with_effect(Creep(gamma=0.02)).simulate(Record(u, np.zeros(1000), 1e-3))
    records, names = (Record(u, y + 1e-9 * rng.normal(size=1000), 1e-3),), ["bouc_wen.p2"]
    alone = fit(MODEL, records, names, floors=[1e-9])
    beside = fit(MODEL.with_effect(Creep(gamma=0.01)), records, [*names, "creep.gamma"], floors=[1e-9])
    low, high = with_alternative(alone, alone, beside).interval("bouc_wen.p2")
    assert low < beside.values["bouc_wen.p2"] < high
    narrow_low, narrow_high = alone.interval("bouc_wen.p2")
    assert not narrow_low < beside.values["bouc_wen.p2"] < narrow_high


def test_a_visible_misfit_counts_with_its_size():
    alone, wider = errors_of(10_000, misfit=1e-7)
    expected = 1e-7 / np.sqrt(PIECES) / (1e-5 / np.sqrt(2.0))
    assert np.sqrt(wider**2 - alone**2) == pytest.approx(expected, rel=0.1)


def test_a_lag_is_known_to_one_sample_at_best():
    period, noise, name = MODEL.sample_period, 1e-9, "amplifier_bandwidth.tau"
    model = MODEL.with_effect(AmplifierBandwidth(tau=0.5 * period))
    u = np.sin(2 * np.pi * 20 * np.arange(20_000) / 20_000)
    record = Record(u, model.simulate(Record(u, np.zeros(u.size), period))[0], period)
    found = fit(model, (record,), [name], floors=[noise])
    found = with_form_uncertainty(found, (record,), Nuisance(), [noise], [noise], SPAN)
    assert found.standard_errors[name] > period / np.sqrt(12.0)


def test_a_largest_slope_is_known_to_one_sample_of_the_longest_rise():
    """A step of 8 V at 1 V a sample; a slow triangle says nothing."""
    period, slope, name = 1e-4, 1e4, "amplifier_slew_limit.S"
    model = Model((AmplifierSlewLimit(S=slope), *MODEL.effects), period, 1.0, 1e-5)
    at_rest, triangle = np.full(50, -4.0), 5.0 - np.abs(np.linspace(-5.0, 5.0, 10_000))
    steps = np.concatenate((at_rest, at_rest + 8.0, at_rest + 5.0))
    records = [Record(u, model.simulate(Record(u, np.zeros(u.size), period))[0], period) for u in (steps, triangle)]
    noise = [1e-9, 1e-9]
    found = fit(model, records, [name], floors=noise)
    wider = with_form_uncertainty(found, records, Nuisance(), noise, noise, 1e-12)
    added = wider.standard_errors[name] ** 2 - found.standard_errors[name] ** 2
    assert np.sqrt(added) == pytest.approx(slope**2 * period / 8.0 / np.sqrt(12.0), rel=1e-3)


def test_the_rise_of_a_drive_counts_only_where_it_is_fast():
    period, slope = 1e-3, 100.0
    sawtooth = np.concatenate((np.linspace(0.0, 9.0, 1000), [6.0, 3.0, 3.01, 0.0]))
    record = Record(sawtooth, np.zeros(sawtooth.size), period)
    assert slope_spread(record, slope) == pytest.approx(slope**2 * period / 6.0 / np.sqrt(12.0))
    assert slope_spread(record, 4000.0) == np.inf
    stepped = replace(record, voltage=np.full(4, 2.0), displacement=np.zeros(4), initial_voltage=-1.0)
    assert slope_spread(stepped, slope) == pytest.approx(slope**2 * period / 3.0 / np.sqrt(12.0))


@pytest.mark.parametrize("averaged", [5, 50])
def test_the_interval_of_the_loop_contains_the_truth_for_triangles_stored_as_averages(averaged):
    """Averages of 1 ms have lost the corners of the drive."""
    period, truth = 2e-5, PlantParameters()
    plant = Plant(truth, period, seed=3)
    records = []
    for frequency, height in ((1.0, 10.0), (1.0, 7.0), (1.0, 4.0), (2.0, 10.0)):
        turns = frequency * period * np.arange(round(3.0 / frequency / period))
        played = plant.run(height * (1.0 - np.abs(1.0 - 2.0 * (turns % 1.0))))
        record = Record(played.voltage, played.displacement, period, phase="triangle", initial_voltage=0.0)
        records.append(record.decimate(averaged))
        plant.settle(0.0)
    found = identify(Experiment(tuple(records)))
    for name in ("beta", "gamma"):
        low, high = found.fit.interval(f"bouc_wen.{name}")
        assert low < getattr(truth.hysteresis, name) < high
