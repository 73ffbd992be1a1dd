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

"""Tables say what the comparison, the model and the data say."""

from __future__ import annotations

import dataclasses

import numpy as np

from piezo_hysteresis.effects import Arx, BoucWen, HysteresisMemory
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Notice
from piezo_hysteresis.report.document import FREE_RUN
from piezo_hysteresis.report.tables.answer_tables import gap_table
from piezo_hysteresis.report.tables.error_table import error_table, frequency_table
from piezo_hysteresis.report.tables.parameter_table import correlation_table, parameter_table
from piezo_hysteresis.report.tables.quality_table import notice_table, record_table
from piezo_hysteresis.report.words import FLOOR, duration, nanometre


def test_every_phase_has_its_error_before_and_after(comparison):
    table = error_table(comparison)
    assert table.header[3:5] == ("baseline [%]", "with creep [%]")
    for row, cells in zip(comparison.now.rows, table.rows, strict=False):
        assert cells[0] == row.phase
        assert cells[4] == f"{row.percent:.3f}"
        assert cells[5] == f"{1e9 * row.rms:.1f}"
    assert table.rows[-1][0] == "all phases"
    assert table.rows[-1][4] == f"{comparison.now.percent:.3f}"


def test_the_frequency_table_has_the_form_of_table_1(comparison):
    table = frequency_table(comparison)
    assert table.header == ("sine of", "1 Hz", "200 Hz")
    assert [row[0] for row in table.rows] == ["baseline [%]", "with creep [%]"]


def fitted(model, names, covariance, at_bounds=()):
    return Fit(model, names, covariance, 1.0, (), (), at_bounds, True, 1)


def test_parameters_show_intervals_bounds_hit_and_correlations(models):
    model = models["with creep"]
    names = ("bouc_wen.A", "bouc_wen.beta", "bouc_wen.p2", "creep.gamma")
    covariance = np.diag([1e-4, 4e-4, 1e-4, 1e-8])
    covariance[0, 2] = covariance[2, 0] = -0.99e-4
    fit = fitted(model, names, covariance, ("creep.gamma",))
    rows = {row[0]: row for row in parameter_table(model, fit).rows}
    assert rows["bouc_wen.beta"][2:4] == ("4.607", "± 0.039")
    assert rows["creep.gamma"][5].endswith("at a bound")
    assert not rows["bouc_wen.A"][5].endswith("at a bound")
    assert rows["creep.gamma"][3] == "", "at a bound, so no interval"
    assert rows["bouc_wen.gamma"][3] == "", "not fitted, so no interval"
    assert correlation_table(fit).rows == (("bouc_wen.p2", "bouc_wen.A", "-0.990"),)
    assert correlation_table(fitted(model, names, np.diag(np.diag(covariance)))) is None


def test_of_many_correlations_the_strongest_are_shown():
    """A fit of plays to one step printed a hundred rows."""
    model = Model((BoucWen(), HysteresisMemory(c=(0.02,) * 16)), 1e-3)
    names = [f"hysteresis_memory.c[{k}]" for k in range(16)]
    table = correlation_table(fitted(model, names, 1e-6 * (np.full((16, 16), 0.97) + 0.03 * np.eye(16))))
    assert len(table.rows) == 12
    assert "the 12 strongest of 120" in table.note


def test_a_number_is_shown_as_exactly_as_its_interval(models):
    """A mode at 236.654 Hz that is known within 0.025 Hz was shown as 236.7 ± 0.025 Hz."""
    model = models["with creep"].with_values({"bouc_wen.p2": 0.8765432})
    half = 2.5e-5
    table = parameter_table(model, fitted(model, ("bouc_wen.p2",), np.array([[(half / 1.96) ** 2]])))
    (row,) = (row for row in table.rows if row[0] == "bouc_wen.p2")
    assert row[3] == "± 2.5e-05"
    assert abs(float(row[2]) - 0.8765432) < 0.1 * half


def test_a_long_array_leaves_room_for_the_table():
    weights = tuple(0.01 * k for k in range(16))
    model = Model((BoucWen(), HysteresisMemory(c=weights), Arx(a=(), b=(1.0,), delay=1.0)), 1e-3)
    rows = {row[0]: row[2] for row in parameter_table(model).rows}
    assert rows["hysteresis_memory.c"] == "16 from 0 to 0.15"
    assert (rows["arx.a"], rows["arx.b"]) == ("none", "1")


def test_the_data_are_reported_as_they_are(experiment, comparison):
    table = record_table(experiment, comparison.noise)
    assert [row[0] for row in table.rows] == [r.phase for r in experiment]
    assert table.rows[3][2] == "200 µs"
    truncated = dataclasses.replace(experiment[0], truncated=True)
    data = Experiment((truncated,), notices=(Notice("minor", "a"), Notice("gap", "b", "step", severe=True)))
    assert record_table(data, comparison.noise[:1]).rows[0][-1] == "truncated"
    assert [row[0] for row in notice_table(data).rows] == ["gap", "minor"], "the severe first"
    assert notice_table(Experiment((truncated,))) is None


def test_the_floor_is_explained_in_one_sentence_everywhere():
    """Errors of 0.020 stood beside a floor of 0.030, which was called the error that noise alone causes."""
    gap = {"before": 0.3, "after": 0.02, "floor": 0.03, "unseen": True, "per_phase": {}}
    table = gap_table({"gap_percent_of_range": gap})
    assert FLOOR.endswith("is its noise or 0.03 % of the range, whichever is larger.")
    assert table.note.endswith(FLOOR) and FLOOR in FREE_RUN


def test_small_lengths_and_times_have_fitting_units():
    assert nanometre(0.0) == "0 nm"
    assert nanometre(-1.5e-6) == "-1.5 µm"
    assert [duration(t) for t in (5e-9, 2e-5, 5e-3, 60.0)] == ["5 ns", "20 µs", "5 ms", "60 s"]
