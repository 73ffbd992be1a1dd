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

"""The page about many recordings names the stage that differs, and where the model class fails."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.report.fleet.changes import changed_stages
from piezo_hysteresis.report.fleet.fleet_page import fleet_page
from piezo_hysteresis.report.fleet.history import FleetHistory, ParameterSeries
from piezo_hysteresis.report.fleet.outliers import outlying_stages

STAGES = [f"s{i}" for i in range(8)]
EACH = 6


def history(shift=0.0, lost=0, spread=0.02) -> FleetHistory:
    """Eight stages whose A differs by 2 %, the last one by `shift` more; errors of s3 are ten times the others'."""
    chance = np.random.default_rng(4)
    stage = np.repeat(STAGES, EACH)
    n = stage.size
    own = np.repeat(1.0 + spread * chance.standard_normal(len(STAGES)), EACH)
    value = own + 0.002 * chance.standard_normal(n) + shift * (stage == "s7")
    done = np.arange(n) >= lost
    error = np.where(stage == "s3", 5.0, 0.5) * np.exp(0.1 * chance.standard_normal(n))
    index = np.flatnonzero(done)
    return FleetHistory(
        source="results",
        task="identify",
        recording=np.array([f"/lab/{s}/{i}.npz" for i, s in enumerate(stage)]),
        stage=stage,
        status=np.where(done, "done", "failed"),
        verdict=np.where(done, np.where(error > 3, "poor", "described"), ""),
        reason=np.array(["" if d else f"/lab/x.npz: got {i} columns, expected <2>" for i, d in enumerate(done)]),
        time=np.tile(np.array([f"2026-{m:02d}-03" for m in range(1, EACH + 1)], "datetime64[us]"), len(STAGES)),
        error=np.where(done, error, np.nan),
        floor=np.full(n, 0.03),
        severe=np.zeros(n, int),
        parameters={
            "bouc_wen.A": ParameterSeries("1", index, value[index], value[index] - 0.004, value[index] + 0.004)
        },
    )


def test_the_stage_that_differs_is_named_alone():
    found = outlying_stages(history(shift=0.3))
    assert [o.stage for o in found] == ["s7"]
    assert found[0].value - found[0].typical == pytest.approx(0.3, abs=0.1)


def test_no_stage_is_named_where_none_differs():
    """3.5 robust deviations of eight stages: a false name in few of fifty fleets."""
    false = 0
    for seed in range(50):
        h = history()
        own = np.repeat(1.0 + 0.02 * np.random.default_rng(seed).standard_normal(len(STAGES)), EACH)
        series = h.parameters["bouc_wen.A"]
        object.__setattr__(h, "parameters", {"x": ParameterSeries("1", series.index, own, own - 0.01, own + 0.01)})
        false += bool(outlying_stages(h))
    assert false <= 10


def test_three_stages_show_no_outlier():
    h = history(shift=5.0)
    kept = np.flatnonzero(np.isin(h.stage, ["s0", "s1", "s7"]))
    series = h.parameters["bouc_wen.A"]
    few = ParameterSeries("1", kept, series.value[kept], series.lower[kept], series.upper[kept])
    object.__setattr__(h, "parameters", {"bouc_wen.A": few})
    assert outlying_stages(h) == ()


def test_a_stage_that_changes_is_named_with_its_change():
    h = history()
    assert changed_stages(h) == ()
    late = (h.stage == "s2") & (h.time > np.datetime64("2026-03-10"))
    series = h.parameters["bouc_wen.A"]
    for part in (series.value, series.lower, series.upper):
        part[late] += 0.05
    (found,) = changed_stages(h)
    assert (found.stage, found.parameter) == ("s2", "bouc_wen.A")
    assert found.later - found.earlier == pytest.approx(0.05, abs=0.01)
    assert "One stage has changed over time: s2, the first in bouc_wen.A." in fleet_page(h).html


@pytest.mark.parametrize("seed", range(5))
def test_what_differs_from_day_to_day_is_no_change(seed):
    """The gain of every stage scatters by 0.5 %, and each recording knows it within 0.05 %; one becomes 10 % larger."""
    h = history()
    index = h.parameters["bouc_wen.A"].index
    value = 1.0 + 0.005 * np.random.default_rng(seed).standard_normal(index.size)
    object.__setattr__(h, "parameters", {"x": ParameterSeries("1", index, value, value - 5e-4, value + 5e-4)})
    assert changed_stages(h) == ()
    value = np.where((h.stage == "s2") & (h.time > np.datetime64("2026-03-10")), 1.1 * value, value)
    object.__setattr__(h, "parameters", {"x": ParameterSeries("1", index, value, value - 5e-4, value + 5e-4)})
    assert [c.stage for c in changed_stages(h)] == ["s2"]


@pytest.mark.parametrize("seed", range(5))
def test_a_change_is_found_that_is_smaller_than_the_error_of_form(seed):
    """Intervals of ± 7 %, which all recordings have in common; they scatter by 0.5 %, and one stage falls by 5 %."""
    h = history()
    index = h.parameters["bouc_wen.A"].index
    value = 1.0 + 0.005 * np.random.default_rng(seed).standard_normal(index.size)
    value = np.where((h.stage == "s2") & (h.time > np.datetime64("2026-03-10")), 0.95 * value, value)
    object.__setattr__(h, "parameters", {"x": ParameterSeries("1", index, value, value - 0.07, value + 0.07)})
    assert [c.stage for c in changed_stages(h)] == ["s2"]


def test_an_interval_that_a_bound_cuts_is_no_reason_for_a_change():
    """Two delays of 0 to 1 ms, both known within 1.1 ms: they differ by less than 1.3 standard errors of 0.56 ms."""
    value = np.where(np.arange(EACH * len(STAGES)) % EACH < EACH // 2, 0.1e-3, 1.1e-3)
    h = history()
    index = h.parameters["bouc_wen.A"].index
    lower, upper = np.maximum(value - 1.1e-3, 0.0), value + 1.1e-3
    object.__setattr__(h, "parameters", {"arx.delay": ParameterSeries("s", index, value, lower, upper)})
    assert h.parameters["arx.delay"].standard_error == pytest.approx(1.1e-3 / 1.96)
    assert changed_stages(h) == ()


def test_a_value_without_an_interval_is_no_reason_for_an_outlying_stage():
    """At a bound, or assumed: it is no estimate."""
    h = history(shift=0.3)
    series = h.parameters["bouc_wen.A"]
    at_bound = h.stage[series.index] == "s7"
    series.lower[at_bound] = series.upper[at_bound] = np.nan
    assert outlying_stages(h) == ()


def test_the_sentences_of_the_page_agree_with_the_numbers(tmp_path):
    page = fleet_page(history(shift=0.3, lost=3))
    assert "45 of 48 recordings have a result" in page.html
    assert "s7, the first in bouc_wen.A" in page.html
    assert "most frequent at s3 (6)" in page.html
    assert "Without a result: 3 failed" in page.html
    assert "expected &lt;2&gt;" in page.html
    assert [d.name for d in page.drawings] == ["parameters_over_time", "errors_over_time", "errors_by_stage"]
    by_stage = page.drawings[-1].data
    assert by_stage["stage"][0] == "s3"
    assert by_stage["median_percent_of_range"][0] == pytest.approx(5.0, rel=0.2)
    page.save(tmp_path / "page.html")
    assert len(list((tmp_path / "page_figures").iterdir())) == 9


def test_results_of_damaged_data_are_called_doubtful():
    """A clipped recording may be described well, and wrongly."""
    found = history()
    assert "doubtful" not in fleet_page(found).html
    found.severe[[3, 7]] = 1
    assert f"make 2 of these results doubtful, the first that of {found.recording[3]}" in fleet_page(found).html


def test_a_page_without_any_result_is_a_page():
    h = history(lost=48)
    object.__setattr__(h, "parameters", {})
    page = fleet_page(h)
    assert "0 of 48 recordings have a result" in page.html
    assert page.drawings == ()


@pytest.mark.parametrize(
    "spread", [0, pytest.param(1, marks=pytest.mark.soak), 5, pytest.param(400, marks=pytest.mark.soak), 4000]
)
def test_any_range_of_dates_has_labels(spread):
    h = history()
    days = np.linspace(0, spread, h.size).astype("timedelta64[D]")
    object.__setattr__(h, "time", (np.datetime64("2026-11-03", "us") + days))
    for drawing in fleet_page(h).drawings[:2]:
        axis = drawing.figure.axes[0]
        assert [label for label in axis.get_xticklabels() if label.get_text()]
