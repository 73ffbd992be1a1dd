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

"""Records of a step and growing sines, without noise phases: the best model that is known is the least delivered."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.discrepancy import Conclusion, Verdict, diagnose
from piezo_hysteresis.discrepancy.gap import Gap, PhaseGap
from piezo_hysteresis.discrepancy.search.selection_result import Selection
from piezo_hysteresis.discrepancy.verdict import CHOSEN, KEPT, REFITTED, conclusion_of_few
from piezo_hysteresis.effects import Arx, Backlash, BoucWen, Creep, Effect, InitialState, ThermalDrift
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4
STAGE = Nanopositioner(mode=310.0, delay=2e-4, pole=2e-4)
SLOW_PERIOD = 1e-3
HIDDEN = {"hysteresis_memory", "level_dependent_memory", "creep", "even_input_polynomial", "extra_resonance"}


def played(stage, frequencies, levels=(0.5, 1.0)):
    drives = ((f"sine_{f:g}hz", growing_sine(f, PERIOD, levels)) for f in frequencies)
    return Experiment(tuple(stage.play(u, PERIOD, name) for name, u in drives))


def percents(model, experiment):
    return [row.percent for row in errors(model, experiment, Nuisance(offset=True)).rows]


@pytest.mark.parametrize(
    "frequencies", [(1.0, 60.0), pytest.param((1.0, 3.0, 20.0, 60.0, 60.0), marks=pytest.mark.soak)]
)
def test_the_saved_model_predicts_a_rate_left_out_as_well_as_the_best_model(frequencies):
    recorded = played(STAGE, frequencies)
    unseen = played(STAGE, (10.0,))
    best = identify(recorded, memory=True).model
    found = diagnose(recorded)
    assert percents(found.model, unseen)[0] < 1.1 * percents(best, unseen)[0] + 0.01
    assert found.gap.after < 0.2 * found.gap.before
    assert found.gap.unseen is (len(frequencies) > 3)
    assert found.verdict is Verdict.NAMED
    assert {"hysteresis_memory", "creep"} <= set(found.names) <= HIDDEN
    intervals = [row["parameters"] for row in found.effects()]
    assert all(np.isfinite(p["interval_95"]).all() for row in intervals for p in row.values())


@pytest.mark.parametrize("place", ["filter_drive", "filter_pole"])
def test_a_pole_before_the_hysteresis_is_named_and_one_behind_it_is_part_of_the_dynamics(place):
    found = diagnose(played(replace(STAGE, pole=2e-5, **{place: 1e-3}), (5.0, 60.0)))
    rows = [row for row in found.effects() if row["name"] == "amplifier_bandwidth"]
    assert len(rows) == (place == "filter_drive")
    for row in rows:
        low, high = row["parameters"]["tau"]["interval_95"]
        assert low <= 1e-3 <= high < 1.2e-3


def test_a_stage_of_the_published_form_gets_no_name():
    loop = BoucWen(A=-0.7691, beta=4.6075, gamma=-0.8725, p1=-0.1085, p2=2.1925)
    stage = Model((loop, Arx(a=(-0.5,), b=(0.2,), delay=1.0)), PERIOD, 10.0, 5e-5)
    rng = np.random.default_rng(3)

    def record(frequency):
        drive = growing_sine(frequency, PERIOD, (0.4, 0.7, 1.0))
        still = Record(drive, drive, PERIOD, f"sine_{frequency:g}hz", initial_voltage=0.0)
        y = stage.simulate(still)[0]
        return Record(drive, y + 2e-4 * np.ptp(y) * rng.normal(size=y.size), PERIOD, still.phase, initial_voltage=0.0)

    assert diagnose(Experiment((record(3.0), record(20.0), record(60.0)))).names == ()


def test_a_truncated_record_is_diagnosed_after_its_first_full_loop():
    whole = played(STAGE, (2.0,), (1.0, 1.0, 1.0)).records[0]
    cut = Record(whole.voltage[1200:], whole.displacement[1200:], PERIOD, "sine_2hz", truncated=True)
    found = diagnose(Experiment((cut,)))
    assert any(n.kind == "conditioning_length" for n in found.experiment.notices)
    assert found.gap.after < 0.2


def sines(*frequencies: float, samples: int = 4000, hidden: Sequence[Effect] = ()) -> list[Record]:
    """Sines without a step, of a stage of the published form and further effects."""
    chain = (BoucWen(), Arx(a=(-0.5,), b=(0.5,), delay=1.0), *hidden)
    stage, rng = Model(chain, SLOW_PERIOD, 10.0, 1e-5), np.random.default_rng(0)
    time = SLOW_PERIOD * np.arange(samples)
    drives = [5.0 - 4.0 * np.cos(2.0 * np.pi * f * time) for f in frequencies]
    gap = 1.1 * SLOW_PERIOD * samples
    still = [
        Record(u, np.zeros(u.size), SLOW_PERIOD, f"sine_{f:g}hz", start_time=k * gap)
        for k, (u, f) in enumerate(zip(drives, frequencies, strict=True))
    ]
    moved = stage.free_run(still)
    return [replace(r, displacement=y + 3e-9 * rng.normal(size=y.size)) for r, y in zip(still, moved, strict=True)]


@pytest.fixture(scope="module")
def creeping() -> list[Record]:
    return sines(0.25, 0.5, 5.0, 20.0, samples=5000, hidden=[Creep(gamma=0.1)])


def test_creep_beside_the_published_loop_is_named(creeping):
    """Plays do not describe such a stage, so the choice of a structure keeps the operator."""
    found = diagnose(creeping)
    assert found.names == ("creep",)
    assert found.gap.after < 0.1 * found.gap.before
    assert not any("creep" in n.message for n in found.experiment.notices if n.kind == "not_tested")


def test_an_initial_state_beside_creep_is_named():
    """Beside the wrong state at rest, the operator describes a creeping stage no better than plays do."""
    found = diagnose(sines(0.5, 5.0, 20.0, hidden=[InitialState(h0=-0.05), Creep(gamma=0.01)]))
    assert found.names == ("initial_state", "creep")
    low, high = found.selection.accepted[0].best.fit.interval("initial_state.h0")
    assert low < high < 0.0
    assert found.gap.after < 1.1 * found.gap.floor


def test_a_mode_beside_a_delay_has_its_own_frequency_and_damping():
    """The lag of a mode that sines do not show before the search is part of the delay, until the mode is fitted."""
    period, w0 = 5e-5, 2.0 * np.pi * 780.0
    b, a, _ = cont2discrete(([w0**2], [1.0, 2.0 * 0.08 * w0, w0**2]), period)
    held = Arx(a=tuple(a[1:]), b=tuple(b[0, 1:]), delay=4.0)  # the mode behind a converter that holds each value
    chain = (BoucWen(A=-0.75, beta=4.0, gamma=-0.8, p1=-0.1, p2=2.1), held)
    stage, rng = Model((Backlash(b=0.05), *chain), period, 10.0, 5e-6), np.random.default_rng(0)
    large = ((1, 5.0, 4.5), (5, 5.0, 4.5), (20, 5.0, 4.5), (80, 5.0, 4.0), (200, 5.0, 2.0))
    small = ((1, 5.0, 2.0), (5, 4.0, 2.0), (20, 3.0, 2.5), (80, 5.0, 1.0), (40, 5.0, 3.0))
    records = []
    for f, offset, amplitude in (*large, *small):
        time = period * np.arange(int(max(0.25, 2.0 / f) / period))
        u = offset - amplitude * np.cos(2.0 * np.pi * f * time)
        still = Record(u, u, period, f"sine_{f}hz")
        records.append(replace(still, displacement=stage.simulate(still)[0] + 4e-9 * rng.normal(size=u.size)))
    found = diagnose(records)
    rows = {row["name"]: row["parameters"] for row in found.effects()}
    assert set(rows) == {"backlash", "extra_resonance"}
    assert "this resonance may be the only one of the stage" in found.reason
    for name, true in (("f0", 780.0), ("zeta", 0.08), ("r", 1.0)):
        low, high = rows["extra_resonance"][name]["interval_95"]
        assert low <= true <= high
    assert found.gap.after < 1.1 * found.gap.floor


def test_the_time_limit_is_the_conclusion_if_it_ended_the_search(creeping):
    given = Model((BoucWen(), Arx(a=(-0.5,), b=(0.5,), delay=1.0)), SLOW_PERIOD, 10.0, 1e-5)
    assert diagnose(creeping[:3], given, time_limit=1e-6).conclusion is Conclusion.TIME_LIMIT


def test_the_time_limit_ends_the_choice_of_a_structure(creeping):
    """Without a broadband record, this choice takes most of the time of a diagnosis."""
    words: list[str] = []
    found = diagnose(creeping, time_limit=1e-6, progress=lambda word, part: words.append(word))
    assert found.conclusion is Conclusion.TIME_LIMIT and not found.names
    assert found.model is not None and found.gap is not None
    assert "gap" in words and "structure: rival" not in words


def test_a_long_record_is_judged_like_the_same_data_recorded_at_the_rate_of_its_averages():
    """Averages have less noise; with the floor of the single samples, V was 0.17 and nothing seemed to be missing."""
    (long,) = sines(0.1, samples=200_000, hidden=[Creep(gamma=0.01)])
    noisy = replace(long, displacement=long.displacement + 1e-7 * np.random.default_rng(1).normal(size=long.size))
    given = Model((BoucWen(), Arx(a=(-0.5,), b=(0.5,), delay=1.0)), SLOW_PERIOD, 10.0, 1e-5)
    fast, slow = (diagnose(r, given, effects=()).selection for r in (noisy, noisy.decimate(10)))
    assert fast.score.excess == pytest.approx(slow.score.excess, rel=1e-6)
    assert fast.null == pytest.approx(1.0)


def test_one_rate_and_one_amplitude_get_no_name():
    found = diagnose(sines(*[1.0] * 5, samples=2000, hidden=[Backlash(b=0.15)]))
    assert found.conclusion is Conclusion.INSUFFICIENT_DATA
    assert "5 records of one rate and amplitude" in found.reason


def test_an_error_of_the_published_model_on_test_records_is_not_nothing_missing():
    """The structure that is chosen may describe them, but it is not the published model."""
    found = diagnose(sines(*[1.0] * 5, hidden=[ThermalDrift(D=3e-7, tau=30.0)]))
    assert found.gap.before > 2.0 * found.gap.floor
    assert found.conclusion is Conclusion.INSUFFICIENT_DATA


def test_nothing_is_missing_in_sines_of_a_published_stage():
    assert diagnose(sines(*[1.0] * 5)).conclusion is Conclusion.NOTHING_MISSING


def test_a_structure_that_fits_does_not_show_that_nothing_is_missing():
    """Without evidence for a single effect there is no verdict on the published model, which is far off."""
    near, far = Score(np.full(4, 0.5), np.zeros(1)), Score(np.full(4, 50.0), np.zeros(1))
    model = Model((BoucWen(),), SLOW_PERIOD, 10.0, 1e-5)
    gap = Gap(1.8, 0.02, 0.03, None, (PhaseGap("sine", 0, 1.8, 0.02, 0.03),), True, 0.02)
    reached = Selection(model, model, near, (), 0.2)
    conclusion, reason = conclusion_of_few(reached, False, far, gap, 4, True, ())
    assert conclusion is Conclusion.INSUFFICIENT_DATA and "explains" in reason


@pytest.mark.parametrize(("after", "left", "named"), [(0.6, 4.0, True), (0.6, 20.0, False), (0.4, 20.0, True)])
def test_a_structure_that_leaves_a_large_gap_must_explain_more(after, left, named):
    """Of a Preisach stage, an even polynomial was named beside the plays, and 4.5 floors remained."""
    before, score = Score(np.full(4, 20.0), np.zeros(1)), Score(np.full(4, np.sqrt(left)), np.zeros(1))
    model = Model((BoucWen(),), SLOW_PERIOD, 10.0, 1e-5)
    gap = Gap(2.0, after, 0.1, None, (PhaseGap("sine", 0, 2.0, after, 0.1),), False, after)
    conclusion, reason = conclusion_of_few(Selection(model, model, score, (), 1.0), True, before, gap, 4, True, ())
    assert (conclusion is Conclusion.MISSING_EFFECT) is named
    assert named or "no effect of the catalogue explains" in reason


def test_the_reason_states_the_share_of_the_measured_gap_and_the_model_that_is_saved():
    """Of a gap from 0.267 to 0.151 % with a floor of 0.03 % it was said that 0 % is explained."""
    score, model = Score(np.full(1, 5.0), np.zeros(1)), Model((BoucWen(),), SLOW_PERIOD, 10.0, 1e-5)
    search = Selection(model, model, score, (), 0.2)

    def reason(after, origin):
        gap = Gap(0.267, after, 0.03, None, (PhaseGap("sine", 0, 0.267, after, 0.03),), False, after)
        return conclusion_of_few(search, False, score, gap, 1, False, (), origin)[1]

    assert "explains 44 % of the gap of the published model" in reason(0.151, CHOSEN)
    assert "explains 44 % of the gap of the given model" in reason(0.151, REFITTED)
    assert "the given model is saved unchanged" in reason(0.267, KEPT)
    assert not any("published" in reason(0.267, origin) for origin in (REFITTED, KEPT))
