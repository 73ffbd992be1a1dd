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

"""Naming on stages whose physics is other code than the catalogue: named, nothing missing, unknown."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.coverage import truth_of
from benchmarks.diagnosis import simulated
from benchmarks.naming_cases import UNKNOWN, Case
from benchmarks.naming_experiments import ProtocolVariant
from piezo_hysteresis.changes.recalibration import recalibrate
from piezo_hysteresis.discrepancy import Conclusion, Verdict, diagnose
from piezo_hysteresis.discrepancy.diagnosis_state import DiagnosisState
from piezo_hysteresis.effects import BY_NAME, CATALOGUE, Arx, BoucWen, Softening
from piezo_hysteresis.errors import DivergenceError, IdentificationError, ParameterError
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.protocol import short
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.provenance import data_hash
from piezo_hysteresis.record import Experiment, Notice, Record
from piezo_hysteresis.report.figures.comparison import compare_diagnosis
from piezo_hysteresis.stage.plant.parameters import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

BRIEF = ProtocolVariant(hold=3.0)
FEW = ("creep", "thermal_drift", "rate_dependent_hysteresis", "softening", "mains_hum", "extra_delay")
"""Effects to choose from where all others cost time only."""


@cache
def recorded(case):
    return case.experiment()


@cache
def answered(case):
    return diagnose(recorded(case), effects=case.library)


def hidden(*names, group="effects", **options):
    return Case(group, names, 1, 5e-4, layout=BRIEF, **options)


def once(case):
    """The experiment with one record of every phase, a third of the samples: enough where no unseen gap is told."""
    phases: dict[str, Record] = {}
    for record in recorded(case):
        if not record.is_named("multisine", "trapezoid"):
            phases.setdefault(record.phase, record)
    return Experiment(tuple(phases.values()))


CREEP = hidden("creep", extra={"creep": ("logarithmic", 0.015)})


@pytest.mark.parametrize("plant", ["independent", "packaged"])
def test_nothing_is_missing_where_nothing_is_hidden(plant):
    found = answered(hidden(plant=plant, group="effect_free"))
    assert found.verdict is Verdict.NOTHING_MISSING
    assert found.names == () and found.effects() == []
    assert found.gap.after <= 1.2 * found.gap.floor


@pytest.mark.soak
def test_a_rate_law_is_found_from_averages_and_not_left_in_a_local_minimum():
    """An average over the end of a ramp moves less than the ramp; the staircase holds 16 of them."""
    case = Case("effects", ("rate_dependent_hysteresis",), 2, 5e-4, layout=ProtocolVariant(hold=1.0))
    found = diagnose(case.experiment())
    assert found.names == ("rate_dependent_hysteresis",)
    assert found.gap.after <= 1.2 * found.gap.floor
    truth = truth_of(case.player()[0], found.model)
    for name, row in found.effects()[0]["parameters"].items():
        low, high = row["interval_95"]
        assert low <= truth[f"rate_dependent_hysteresis.{name}"] <= high


@pytest.mark.parametrize("case", [CREEP, hidden("thermal_drift")], ids=lambda case: case.truth[0])
def test_a_hidden_effect_is_named_and_its_gap_closes_on_unseen_records(case):
    found = answered(case)
    assert found.names == case.truth
    assert found.gap.unseen
    assert found.gap.before > 1.2 * found.gap.floor
    assert found.gap.after <= 1.3 * found.gap.floor


@pytest.mark.parametrize("size", [pytest.param(0.05, marks=pytest.mark.soak), 5.0])
def test_plays_beside_a_loop_are_named_and_described_whether_small_or_larger_than_the_loop(size):
    """They are at rest wherever a record begins; nine of linear half widths, where the catalogue has eight."""
    found = answered(hidden("hysteresis_memory", extra={"hysteresis_memory": size}))
    assert found.names == ("hysteresis_memory",)
    assert found.gap.after <= 1.3 * found.gap.floor


def test_hum_of_a_network_that_is_not_at_its_nominal_frequency_hides_no_other_effect():
    library = tuple(BY_NAME[n] for n in ("creep", "thermal_drift", "mains_hum"))
    case = hidden("thermal_drift", "mains_hum", group="pairs", extra={"mains_hum": (59.96, 8e-3)})
    found = diagnose(recorded(case), effects=library)
    assert set(found.names) == {"thermal_drift", "mains_hum"}
    assert found.model.values()["mains_hum.f"] == pytest.approx(59.96, abs=1e-3)
    assert found.gap.after <= 1.3 * found.gap.floor


def test_a_sensor_that_is_set_to_zero_before_every_record_is_no_missing_effect():
    experiment = recorded(Case("effect_free", (), 1, 1e-5, layout=BRIEF))
    zeroed = (replace(r, displacement=r.displacement - r.displacement[0]) for r in experiment)
    found = diagnose(replace(experiment, records=tuple(zeroed)), effects=[BY_NAME["hysteresis_memory"]])
    assert found.verdict is Verdict.NOTHING_MISSING
    assert found.model.values()["offset.settling"] == pytest.approx(-1.0, abs=0.01)
    assert found.gap.after <= 1.2 * found.gap.floor


def test_data_of_an_explicit_step_have_an_answer_on_request_only():
    integrated = recorded(Case("effect_free", (), 3, 5e-4, "explicit", layout=BRIEF))
    library = [BY_NAME[n] for n in ("creep", "mains_hum")]
    found = diagnose(integrated, effects=library)
    assert found.conclusion is Conclusion.INSUFFICIENT_DATA
    assert "--explicit-step" in found.reason
    found = diagnose(integrated, effects=library, explicit_step=True)
    assert found.conclusion is Conclusion.NOTHING_MISSING


def test_an_effect_outside_the_catalogue_is_unknown():
    case = hidden(group="uncatalogued", extra={"unknown": UNKNOWN["line"], "unknown_name": ("line",)})
    found = diagnose(once(case), effects=[BY_NAME[n] for n in ("creep", "thermal_drift", "softening")])
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects() == []
    assert "no effect of the catalogue explains" in found.reason
    assert "Something is missing" not in found.reason, "it also stands below the headline that no change is visible"


def test_an_effect_that_only_test_records_show_is_not_ignored():
    case = hidden(plant="independent", group="effect_free")
    experiment, aside = recorded(case), {p.index for p in answered(case).gap.per_phase}
    swing = np.ptp(experiment.named("triangle")[0].displacement)
    records = tuple(
        replace(r, displacement=r.displacement + 2e-3 * swing * np.sin(np.arange(r.size) / 5.0)) if i in aside else r
        for i, r in enumerate(experiment)
    )
    found = diagnose(replace(experiment, records=records))
    assert found.conclusion is Conclusion.INSUFFICIENT_DATA
    assert "test records" in found.reason


def test_without_the_true_family_no_other_effect_is_named():
    library = ("thermal_drift", "gain_drift", "extra_delay", "axis_coupling")
    found = diagnose(once(CREEP), effects=[BY_NAME[n] for n in library])
    assert found.verdict is Verdict.UNKNOWN
    assert found.names == ()
    assert diagnose(once(CREEP), effects=[BY_NAME[n] for n in (*library, "creep")]).names == ("creep",)


def test_the_answer_has_its_stable_form():
    answer = json.loads(json.dumps(answered(CREEP).answer("better.yaml"), allow_nan=False))
    assert answer["schema"] == 1
    assert (answer["verdict"], answer["conclusion"]) == ("named", "missing_effect")
    (effect,) = answer["effects"]
    assert effect["name"] == "creep" and effect["family"] == "creep"
    assert isinstance(effect["member_certain"], bool)
    assert 0.6 <= effect["explained_fraction"] <= 1.0
    assert effect["held_out_gain"] > 0.15
    assert isinstance(effect["confusable_with"], list)
    for row in effect["parameters"].values():
        low, high = row["interval_95"]
        assert low <= row["value"] <= high
        assert isinstance(row["unit"], str)
    axes = {
        "phase",
        "frequency",
        "amplitude",
        "direction",
        "turning_point_distance",
        "time_since_level_change",
        "absolute_time",
    }
    assert {place["axis"] for place in answer["where"]} == axes
    assert all(0.0 <= place["share"] <= 1.0 and isinstance(place["detail"], str) for place in answer["where"])
    gap = answer["gap_percent_of_range"]
    assert gap["before"] > gap["after"] > 0 and gap["floor"] > 0
    assert all(set(phase) == {"before", "after", "floor"} for phase in gap["per_phase"].values())
    assert all(set(row) == {"name", "reason"} for row in answer["rejected"])
    assert len(answer["rejected"]) > 5
    following = answer["next_experiment"]
    assert following is None or (isinstance(following["phase"], str) and len(following["separates"]) == 2)
    assert answer["data_quality"] == []
    assert answer["model"] == "better.yaml"


@pytest.mark.soak
def test_an_answer_that_nothing_is_missing_asks_for_no_experiment():
    """What a small softening leaves is at the floor, so nobody needs to know if it or a sensor nonlinearity did it."""
    found = diagnose(simulated(16))
    assert found.verdict is Verdict.NOTHING_MISSING
    assert found.selection.accepted[0].confusable_with
    assert found.next_experiment is None


def triangle(records):
    t = 1e-3 * np.arange(2000)
    u = 4 * np.abs((t % 1) * 2 - 1)
    return tuple(Record(u, 1e-6 * u, 1e-3, phase="triangle") for _ in range(records))


def test_a_record_of_few_samples_is_not_compared_with_a_model():
    u = np.array([0.0, 1.0, 3.0])
    few = Record(u, 2e-6 * u, 1e-3, phase="step")
    assert DiagnosisState(Experiment((*triangle(2), few)), None, CATALOGUE, print).usable == [0, 1]
    assert DiagnosisState(Experiment((few,)), None, CATALOGUE, print).usable == [0]


def test_one_phase_is_not_enough_for_a_verdict():
    found = diagnose(Experiment(triangle(1)))
    assert found.verdict is Verdict.UNKNOWN
    assert "one record" in found.reason
    assert "explains" not in found.reason, "there is no gap to explain"
    assert "these data can hardly show creep" in found.reason
    answer = found.answer()
    assert answer["effects"] == [] and answer["verdict"] == "unknown"


def test_severe_damage_forbids_a_verdict():
    notice = Notice("clipped", "displacement is clipped in 30 % of the samples", "triangle", severe=True)
    found = diagnose(Experiment(triangle(6), notices=(notice,)))
    assert found.verdict is Verdict.UNKNOWN
    assert notice.message in found.reason
    assert found.answer()["data_quality"][0]["severe"] is True
    gap = found.answer()["gap_percent_of_range"]
    assert gap["before"] is None
    assert gap["per_phase"] == {}


def test_a_stage_that_was_not_driven_is_refused():
    still = Record(np.full(100, 3.0), np.arange(100.0), 1e-3, phase="rest")
    with pytest.raises(IdentificationError, match="does not move"):
        diagnose(Experiment((still,) * 5))


@pytest.mark.parametrize("given", [None, Model((BoucWen(), Arx(a=(), b=(1.0,))), 1e-3, 4.0, 4e-6)])
def test_a_drive_that_only_prepares_the_stage_is_refused(given):
    (loops,) = triangle(1)
    rest = Record(np.zeros(100), np.zeros(100), 1e-3, phase="rest")
    short = Record(np.full(10, 3.0), np.zeros(10), 1e-3, phase="step", initial_voltage=0.0)
    prepared = replace(loops, phase="conditioning")
    for records in ([replace(loops, phase="hold")], [prepared, rest], [short, rest]):
        with pytest.raises(IdentificationError, match="does not move"):
            diagnose(Experiment(tuple(records)), given)


@pytest.mark.parametrize("count", [1, 4])
def test_a_displacement_that_never_changes_is_refused(count):
    dead = [replace(r, displacement=np.full(r.size, 1e-6)) for r in triangle(count)]
    given = Model((BoucWen(), Arx(a=(), b=(1.0,))), 1e-3, 4.0, 4e-6)
    for tried in (None, given):
        with pytest.raises(IdentificationError, match="the displacement never changes"):
            diagnose(Experiment(tuple(dead)), tried)
    with pytest.raises(IdentificationError, match="the displacement never changes"):
        recalibrate(given, Experiment(tuple(dead)))


def test_loops_that_are_all_named_validation_are_diagnosed():
    """A rest beside them is nothing that a model can be fitted to."""
    loops = [replace(r, phase="validation") for r in triangle(4)]
    rest = Record(np.zeros(100), np.zeros(100), 1e-3, phase="rest")
    assert diagnose(Experiment((*loops, rest))).verdict is not Verdict.NAMED


@pytest.mark.parametrize("identified_from_it", [False, True])
def test_a_model_that_diverges_on_a_test_record_ends_with_an_answer(identified_from_it):
    """Without the comparison with the given model, too, which the data that it was identified from do not need."""
    chain = BoucWen(), Arx(a=(-1.58, 0.79), b=(0.21,), delay=1.0)
    stage = Model(chain, 2e-4, 10.0, 1e-5)
    given, rng, time = stage.with_effect(Softening(k3=-0.08)), np.random.default_rng(0), 2e-4 * np.arange(3000)
    noise = np.clip(3.0 + 0.3 * rng.normal(size=(2, 3000)), 0.0, 10.0)
    drives = (*noise, 3.0 - 3.0 * np.cos(2 * np.pi * 2.0 * time), 3.0 - 2.0 * np.cos(2 * np.pi * 5.0 * time))
    small = [Record(u, u, 2e-4, p) for u, p in zip(drives, ("noise", "noise", "sine_2hz", "sine_5hz"), strict=True)]
    large = Record(5.0 + 4.0 * np.sin(2 * np.pi * 290.0 * time), time, 2e-4, "validation", initial_voltage=5.0)
    with pytest.raises(DivergenceError):
        given.free_run([large])
    moved = [replace(r, displacement=given.free_run([r])[0] + 5e-9 * rng.normal(size=3000)) for r in small]
    experiment = Experiment((*moved, replace(large, displacement=stage.free_run([large])[0])))
    origin = {"data_hash": data_hash(experiment)} if identified_from_it else {}
    found = diagnose(experiment, replace(given, provenance=origin))
    assert found.conclusion is Conclusion.INSUFFICIENT_DATA and "diverges on a test record" in found.reason
    assert np.isfinite(found.gap.after) and not found.gap.unseen and found.where
    assert compare_diagnosis(found).model is None  # the page


def test_no_effect_is_named_if_its_twin_was_not_a_candidate():
    stage = Case("poor", ("softening",), 1, 5e-4)
    found = diagnose(stage.experiment(), effects=[BY_NAME[n] for n in ("softening", "extra_delay")])
    assert found.conclusion is Conclusion.UNEXPLAINED_GAP
    assert "the closest effect is softening" in found.reason and "sensor_nonlinearity" in found.reason


def test_a_search_that_runs_out_of_time_gives_the_best_answer_so_far():
    experiment = recorded(CREEP)
    found = diagnose(experiment, time_limit=1e-9)
    assert found.conclusion is Conclusion.TIME_LIMIT
    assert "the time limit ended the search" in found.reason
    assert found.gap.after == pytest.approx(found.gap.before)
    with pytest.raises(ParameterError, match="more than 0 s"):
        diagnose(experiment, time_limit=0.0)
    with pytest.raises(ParameterError, match="got 'creep' in effects, expected classes of effects"):
        diagnose(experiment, effects=["creep"])


def test_logarithmic_creep_is_saved_as_the_correct_law():
    found = answered(CREEP)
    (effect,) = found.effects()
    low, high = effect["parameters"]["gamma"]["interval_95"]
    assert effect["law"] == "creep" and "creep" in found.model
    assert low <= 0.015 <= high


def test_creep_continues_from_phase_to_phase():
    """Phases that were played in one go last 18 s together: relaxations longer than the longest phase belong to it."""
    stage = SimulatedStage(PlantParameters().with_values({"creep.gamma": 0.015}), seed=1, sample_period=1e-4)
    described = stage.description
    limits = DriveLimits(1e-4, described.voltage_min, described.voltage_max, 0.0, described.max_slew_rate)
    records = list[Record]()
    for phase in short(limits, 1):
        records.append(stage.play(phase.voltage, phase.name, continues=bool(records), average=phase.stored_every))
    library = [e for e in CATALOGUE if e.name in FEW or e.family == "creep"]
    (effect,) = diagnose(Experiment(tuple(records)), effects=library).effects()
    low, high = effect["parameters"]["gamma"]["interval_95"]
    assert effect["law"] == "creep"
    assert low <= 0.015 <= high


def test_an_error_of_a_diagnosis_names_no_other_command():
    """The model that a diagnosis begins with is identified, and the error was that of another command."""
    wave = np.sin(0.5 * np.arange(24))
    with pytest.raises(IdentificationError, match=r"^got 24 samples"):
        diagnose(Experiment((Record(wave, 1e-6 * wave, 1e-3, "sine_10hz"),)))
