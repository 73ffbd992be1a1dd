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

"""Answer, page and live prediction of one diagnosis say the same, for every stage of the demonstration."""

import re

import numpy as np
import pytest

from benchmarks.naming_cases import Case
from examples.demo.truth import in_numbers_of
from examples.hide_effect import individual_stage
from piezo_hysteresis.discrepancy import Verdict, diagnose, gap
from piezo_hysteresis.discrepancy.gap import measure_gap
from piezo_hysteresis.effects import MainsHum
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.protocol import protocol
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.comparison import compare_diagnosis
from piezo_hysteresis.report.verdict import verdict
from piezo_hysteresis.stage.hidden import hidden_effect
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

HUM = Case("poor", ("mains_hum",), 1, 3e-4, "packaged")


def recorded(seed):
    plan = protocol.short(DriveLimits(), 0)
    stage = SimulatedStage(hidden_effect(seed, individual_stage(seed)).parameters, seed=seed)
    stage.configure(plan.limits.sample_period)
    return Experiment(tuple(stage.play(p.voltage, p.name, average=p.stored_every) for p in plan))


@pytest.fixture(scope="module")
def with_hum():
    return diagnose(HUM.experiment())


def test_hum_is_explained_in_the_recordings_and_not_predicted_live(with_hum):
    found = with_hum
    check_agreement(found)
    assert found.verdict is Verdict.NAMED
    # the amplifier of this stage has a pole, which was not hidden
    assert found.names == ("mains_hum", "amplifier_bandwidth")
    low, high = found.fit.interval(f"{found.selection.accepted[-1].best.name}.tau")  # whatever form of the pole
    assert low < 1.0 / (2.0 * np.pi * PlantParameters().electronics.amplifier_bandwidth) < high
    assert found.gap.after < 1.3 * found.gap.floor
    assert found.gap.live > 0.5 * found.gap.before


def test_a_model_that_knows_the_hum_is_not_told_of_a_gap(with_hum):
    """Amplitude and phase of hum are free in every record, for the given model as for the one that named it."""
    found = diagnose(HUM.experiment(), with_hum.model)
    assert found.verdict is Verdict.NOTHING_MISSING
    assert found.gap.before < 1.3 * found.gap.floor


def test_a_model_that_diverges_on_a_test_record_is_not_named(monkeypatch):
    def measured(models, *others, **options):
        if "mains_hum" in models[1]:
            raise DivergenceError("arx", 0, 0.0)
        return measure_gap(models, *others, **options)

    monkeypatch.setattr(gap, "measure_gap", measured)
    found = diagnose(HUM.experiment(), effects=[MainsHum])
    assert found.verdict is Verdict.UNKNOWN
    assert found.names == ()
    assert "mains_hum" not in found.model


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(20))
def test_every_stage_of_the_demonstration_is_reported_the_same_everywhere(seed):
    found = diagnose(recorded(seed))
    check_agreement(found)
    hidden = hidden_effect(seed, individual_stage(seed))
    same = in_numbers_of(found.model, hidden.parameters, hidden.changes) if found.names else {}
    for name, value in same.items():
        effect, _, number = name.partition(".")
        (row,) = (row for row in found.effects() if row["name"] == effect)
        low, high = row["parameters"][number]["interval_95"]
        assert low <= value <= high


def check_agreement(found):
    answer, experiment = found.answer(), found.experiment
    gap = answer["gap_percent_of_range"]
    after = compare_diagnosis(found)
    for errors, when in ((after.before or after.now, "before"), (after.now, "after")):
        shown = np.sqrt(np.mean([errors.rows[p.index].percent ** 2 for p in found.gap.per_phase]))
        assert shown == pytest.approx(gap[when], rel=0.05, abs=0.1 * gap["floor"])
    errors = [r.displacement - y for r, y in zip(experiment, found.model.simulate(experiment), strict=True)]
    live = [100.0 * np.sqrt(np.mean(errors[p.index] ** 2)) / after.now.range for p in found.gap.per_phase]
    assert np.sqrt(np.mean(np.square(live))) == pytest.approx(gap["live"], rel=0.1, abs=0.1 * gap["floor"])
    fitted_per_record = [e for e in answer["effects"] if not e["predicted_live"]]
    per_phase = gap["per_phase"].values()
    before, rest = (np.mean([(p[when] / p["floor"]) ** 2 for p in per_phase]) for when in ("before", "after"))
    if answer["effects"]:
        said = f"{100.0 * (1.0 - np.sqrt(max(0.0, rest - 1.0) / (before - 1.0))):.0f} % of the gap"
        assert said in answer["reason"] and said in found.summary()
    page = verdict(after, answer)
    for text in (answer["reason"], " ".join(page.sentences)):
        assert bool(re.search("(not|cannot be) predicted live", text)) is bool(fitted_per_record)
    assert fitted_per_record or gap["live"] == gap["after"]


def test_a_held_level_is_found_in_a_record_that_is_interpolated():
    """Between equal samples, the spline moves by 1e-217: the answer said that no level is held."""
    rng, period = np.random.default_rng(0), 5e-4
    t = period * np.arange(2000)
    loop = np.abs(np.mod(2 * t + 0.5, 1.0) * 2.0 - 1.0)
    drives = [(0.5 + 0.02 * rng.normal(size=2000), 1)] + [(a * loop, 1) for a in (1.0, 0.6, 0.3)]
    at, levels = (0.0, 0.03, 1.3, 1.33, 2.6, 2.63), (0.0, 0.1, 0.1, 0.7, 0.7, 0.3)
    drives += [(np.interp(2 * period * np.arange(4000), at, levels), 2)]
    records = [Record(u, 1e-5 * u + 2e-9 * rng.normal(size=u.size), n * period) for u, n in drives]
    found = diagnose(records)
    assert found.selection is not None
    assert not any("level is held" in n.message for n in found.experiment.notices)
