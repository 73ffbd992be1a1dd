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

"""Corrections without a name: a form that generalises is accepted, and a free filter bank that learns well is not."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from piezo_hysteresis.blocks.block import Block
from piezo_hysteresis.blocks.relaxation import RelaxationBlock
from piezo_hysteresis.discrepancy.diagnose import compare_with_given_model
from piezo_hysteresis.discrepancy.diagnosis_state import DiagnosisState
from piezo_hysteresis.discrepancy.gap import PhaseGap
from piezo_hysteresis.discrepancy.search.baseline_setup import BaselineSetup
from piezo_hysteresis.discrepancy.unnamed.correction import Correction, without_corrections
from piezo_hysteresis.discrepancy.unnamed.held_out import held_out
from piezo_hysteresis.discrepancy.unnamed.offer import best_correction, fitted_correction
from piezo_hysteresis.effects import (
    CATALOGUE,
    Arx,
    BoucWen,
    CorrectionShape,
    Discretisation,
    Effect,
    Offset,
    UnnamedCorrection,
    UnnamedPlays,
    UnnamedPositionMap,
)
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.normal_equations import residuals
from piezo_hysteresis.identification.identified_range import outside_of
from piezo_hysteresis.identification.training.joint_fit import LAST, joint
from piezo_hysteresis.identification.training.model_score import score_baseline
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model import model_file
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.parameter import Parameter
from piezo_hysteresis.record import Experiment, Record

PERIOD, SCALE, FLOOR = 1e-3, 1e-5, 2e-9
PLAIN = Model((BoucWen(), Arx(b=[0.3]), Offset(y0=1e-7)), PERIOD, displacement_scale=SCALE)
TAU = np.geomspace(5e-3, 0.5, 5)


class FreeBank(UnnamedCorrection):
    """Five relaxations with weights that are free: it can imitate any lag at one rate."""

    name = "free_bank"
    depends_on = "past"
    parameters = (Parameter("c", "c_j", "1", (0.0,) * 5, -1.0, 1.0, "weights", "test", 0.0, 0.01),)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"free_bank.c[{j}]" for j in range(5))
        slopes = np.hstack((-np.ones((5, 1)), np.eye(5)))
        return RelaxationBlock(names, TAU, setting.sample_period, self.array("c") @ slopes, slopes)

    def shape(self, displacement_scale: float) -> CorrectionShape:
        return CorrectionShape("relaxation time", "s", TAU, "weight", "1", self.array("c"))


def played(plant: Model, rate: float, height: float, seed: int) -> Record:
    """Two cycles of a sine from 0 V, with noise."""
    t = np.arange(max(300, int(2.0 / rate / PERIOD))) * PERIOD
    bare = Record(0.5 * height * (1.0 - np.cos(2.0 * np.pi * rate * t)), t, PERIOD, phase="sine")
    noise = np.random.default_rng(seed).normal(scale=FLOOR, size=t.size)
    return replace(bare, displacement=plant.simulate(bare)[0] + noise)


def setup_of(plant: Model) -> BaselineSetup:
    """Sines of three rates and three amplitudes, of which every one in the middle of both is set aside."""
    drives = [(rate, height) for rate in (0.7, 4.0, 25.0) for height in (3.0, 5.0, 8.0)]
    drives += [(1.5, 6.0), (10.0, 4.0)]
    records = tuple(played(plant, *drive, seed) for seed, drive in enumerate(drives))
    chosen, least = range(9), np.full(len(records), FLOOR)
    span = float(np.ptp([r.displacement.max() for r in records] + [0.0]))
    data = TrainingData(records[:9], least[:9], Extent.of(records, PLAIN.voltage_scale, PLAIN.displacement_scale))
    fit = joint(PLAIN, data, LAST)
    data, score = score_baseline(fit, data)
    lost = [np.zeros(r.size) for r in records]
    return BaselineSetup(
        records, records, lost, least, least, span, range(len(records)), chosen, (9, 10), data, fit, score
    )


def hump() -> UnnamedPositionMap:
    """A deviation at one position."""
    x = np.linspace(0.0, 0.55, 22)[1:-1]
    return UnnamedPositionMap(m=tuple(0.004 * np.exp(-(((x - 0.2) / 0.04) ** 2))), low=0.0, high=0.55)


@pytest.fixture(scope="module")
def of_position() -> BaselineSetup:
    return setup_of(PLAIN.with_effect(hump()))


@pytest.fixture(scope="module")
def of_friction() -> BaselineSetup:
    return setup_of(PLAIN.with_effect(UnnamedPlays(c=(0.0, 0.0, 0.2, 0.2, 0.0, 0.0, 0.0), reach=0.3)))


@pytest.fixture(scope="module")
def found(of_position: BaselineSetup) -> Correction:
    return best_correction(of_position.baseline.model, of_position, Experiment(of_position.given))


def test_plays_that_never_move_leave_the_errors_as_they_are(of_position: BaselineSetup) -> None:
    """It ended with an error of the linear algebra."""
    model, data = of_position.baseline.model, of_position.training_data
    idle = model.with_effect(UnnamedPlays(c=(0.0,) * 7, reach=10.0))
    without, with_idle = held_out(model, data), held_out(idle, data, UnnamedPlays.name)
    np.testing.assert_allclose(with_idle.by_rate, without.by_rate, rtol=0.05)


def test_a_deviation_of_the_position_is_offered_with_its_shape(found: Correction) -> None:
    assert found.accepted and isinstance(found.effect, UnnamedPositionMap)
    assert found.removed >= 0.5 and found.worst <= 1.05
    shape = found.effect.shape(SCALE)
    assert shape.x[np.argmax(shape.y)] == pytest.approx(0.2 * SCALE, abs=0.04 * SCALE)
    assert "does not state the cause" in found.sentence()
    assert found.answer()["depends_on"] == "position"


@pytest.mark.parametrize("before", [0.0, 1e-6])
def test_an_error_that_stays_below_the_floor_refuses_no_correction(found: Correction, before: float) -> None:
    """A stage that rests at 0 V has no error without noise; the quotient was no number, or any number."""
    rest = PhaseGap("rest", 0, before, 2.0 * before, 0.03)
    assert replace(found, gap=replace(found.gap, per_phase=(rest,))).worst <= 1.0


def test_the_corrected_model_is_saved_with_its_range(of_position: BaselineSetup, found: Correction) -> None:
    again = model_file.loads(model_file.dumps(found.model))
    record = of_position.records[9]
    np.testing.assert_array_equal(again.simulate(record), found.model.simulate(record))
    assert not [*outside_of(again, record)]
    (told,) = [n for n in outside_of(again, played(PLAIN, 4.0, 11.0, 0)) if n.kind == "outside_amplitudes"]
    assert "correction without a name is not valid there" in told.message


def test_a_correction_is_zero_outside_the_recorded_positions() -> None:
    far = np.linspace(0.56, 2.0, 50)
    block = hump().block(Discretisation(PERIOD, PERIOD))
    np.testing.assert_array_equal(block.run(far, None)[0], far)


def test_friction_of_the_position_is_offered_as_plays(of_friction: BaselineSetup) -> None:
    found = best_correction(of_friction.baseline.model, of_friction, Experiment(of_friction.given))
    assert found.accepted and isinstance(found.effect, UnnamedPlays)
    assert found.removed >= 0.5 and found.worst <= 1.05


def test_a_free_filter_bank_fits_well_but_is_refused_at_other_rates(of_friction: BaselineSetup) -> None:
    model, data = of_friction.baseline.model, of_friction.training_data
    one_rate = replace(data, records=data.records[3:6], floors=data.floors[3:6], alone=())
    learnt = joint(model.with_effect(FreeBank()), one_rate, LAST).model
    before, after = (
        np.array([np.sqrt(np.mean(e**2)) for e in residuals(m, data.records, data.free_with(m))])
        for m in (model, learnt)
    )
    ratios = after / before
    assert ratios[3:6].mean() < 0.7, "it learns the rate that it is shown"
    assert min(ratios[:3].mean(), ratios[6:].mean()) > 3.0, "and is three times worse at the others"
    errors = held_out(model, data)
    refused = fitted_correction(model, FreeBank(), errors, data)
    assert refused is None or not refused.accepted
    assert fitted_correction(model, UnnamedPlays(reach=0.3), errors, data).accepted


def test_a_correction_is_never_part_of_naming(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not any(issubclass(effect, UnnamedCorrection) for effect in CATALOGUE)
    corrected = PLAIN.with_effect(hump())
    assert [e.name for e in without_corrections(corrected).effects] == [e.name for e in PLAIN.effects]
    module = import_module("piezo_hysteresis.discrepancy.diagnose")  # of the same name as its function
    monkeypatch.setattr(module, "same_stage", lambda *_: None)
    record = played(PLAIN, 4.0, 5.0, 0)
    state = DiagnosisState(Experiment((record,)), corrected, CATALOGUE, lambda *_: None)
    assert hump().name not in compare_with_given_model(state).model


def test_records_of_one_rate_cannot_accept_a_correction(of_position: BaselineSetup) -> None:
    data = of_position.training_data
    one = replace(data, records=data.records[3:6], floors=data.floors[3:6], alone=())
    alone = replace(of_position, training_data=one)
    assert best_correction(of_position.baseline.model, alone, Experiment(alone.given)) is None
