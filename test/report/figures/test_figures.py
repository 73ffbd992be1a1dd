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

"""Every figure against a closed form, and what all figures owe their reader."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.bode import bode
from piezo_hysteresis.report.figures.comparison import compare
from piezo_hysteresis.report.figures.creep import creep
from piezo_hysteresis.report.figures.loops import cycles, opening
from piezo_hysteresis.report.figures.residual_maps import residual_maps
from piezo_hysteresis.report.figures.spectrum import residual_spectrum
from piezo_hysteresis.report.figures.step import step
from piezo_hysteresis.report.figures.thinning import thinned
from piezo_hysteresis.report.figures.time_series import window
from piezo_hysteresis.report.figures.whiteness import whiteness
from piezo_hysteresis.report.page import SECTIONS

FIGURES = [figure for figures in SECTIONS.values() for figure in figures]


def linear(period: float, gain: float = 1e-5) -> Model:
    """y = gain·u one sample later: hysteresis off."""
    return Model((BoucWen(A=0.0, p1=0.0, p2=1.0), Arx(b=[1.0])), period, 1.0, gain)


def test_figures_owe_their_reader_words_and_numbers(figures):
    assert len(figures) == len(FIGURES)
    for drawing in figures.values():
        assert len(drawing.alternative) > 40
        assert any(c.isdigit() for c in drawing.alternative)
        assert "nan" not in drawing.alternative
        rows = list(csv.reader(io.StringIO(drawing.csv())))
        assert rows[0] == list(drawing.data)
        assert len(rows) == 1 + max(np.size(c) for c in drawing.data.values())


@pytest.mark.parametrize("figure", FIGURES, ids=lambda f: f.__name__)
def test_without_a_model_a_figure_shows_the_data_or_nothing(figure, bare):
    drawing = figure(bare)
    if drawing is not None:
        assert not any("predicted" in column or "residual" in column for column in drawing.data)
        assert not any(word in drawing.caption for word in ("predicted", "residual", "model"))


@pytest.mark.parametrize("figure", FIGURES, ids=lambda f: f.__name__)
def test_one_poor_record_is_drawn_or_left_out(figure):
    t = 1e-2 * np.arange(40)
    record = Record(t, 1e-6 * t, 1e-2, phase="record")
    figure(compare(Experiment((record,)), {"model": linear(1e-2)}))


def test_measured_and_predicted_differ_by_more_than_their_colour(figures):
    (axis, *_) = figures["loops_by_amplitude"].figure.get_axes()
    measured, predicted = axis.get_lines()[:2]
    assert measured.get_color() != predicted.get_color()
    assert measured.get_linestyle() != predicted.get_linestyle()


def test_the_opening_of_an_ellipse_is_the_sine_of_its_phase():
    angle = np.linspace(-np.pi / 2, 3 * np.pi / 2, 4001)
    assert opening(np.sin(angle), np.sin(angle - 0.3)) == pytest.approx(100 * np.sin(0.3), rel=1e-3)


@given(st.lists(st.floats(0.3, 1.0), min_size=1, max_size=6))
def test_cycles_of_a_triangle_are_its_peaks(peaks):
    u = np.concatenate(
        [np.concatenate((np.linspace(0, p, 50)[:-1], np.linspace(p, 0, 50)[:-1])) for p in peaks] + [[0]]
    )
    found = cycles(Record(u, u, 1e-3))
    assert [c.swing for c in found] == pytest.approx(peaks)


def test_loops_are_sorted_by_swing_and_every_frequency_has_one(figures):
    by_amplitude = figures["loops_by_amplitude"]
    swings = [np.ptp(by_amplitude.data[f"voltage_V_{i}"]) for i in range(1, 5)]
    assert swings == pytest.approx(sorted(swings, reverse=True))
    assert swings[0] == pytest.approx(10.0, rel=0.01)
    assert "200 Hz" in figures["loops_by_frequency"].alternative


def test_logarithmic_creep_is_a_straight_line_of_its_slope():
    gamma, period = 0.015, 1e-2
    t = period * np.arange(3000)
    level = np.where(t >= 1.0, 2.0, 0.0)
    since = np.maximum(t - 1.0 + period, period)
    y = 1e-5 * level * (1 + gamma * np.log10(since / 0.1))
    drawing = creep(compare(Experiment((Record(level, y, period, phase="staircase"),))))
    time, percent = drawing.data["time_since_change_s"], drawing.data["measured_percent"]
    assert percent == pytest.approx(100 * gamma * np.log10(time / 0.1), abs=0.06)
    assert percent[-1] > 3.0


def test_bode_covers_the_truth_within_two_sigma(signal):
    period, pole = 1e-4, 0.7
    u = lfilter([1.0], [1.0, -0.5], signal.normal(size=60_000))
    y = 1e-6 * lfilter([0.0, 0.0, 1 - pole], [1.0, -pole], u) + 1e-7 * signal.normal(size=u.size)
    data = bode(compare(Experiment((Record(u, y, period, phase="noise"),)))).data
    f = data["frequency_Hz_1"]
    z = np.exp(2j * np.pi * f * period)
    truth = 1e-6 * (1 - pole) / (1 - pole / z) / z**2
    off = np.abs(data["gain_m_per_V_1"] / np.abs(truth) - 1.0)
    assert np.mean(off < 2 * data["relative_deviation_1"]) > 0.85
    turn = np.angle(np.exp(1j * np.radians(data["phase_deg_1"])) / np.exp(1j * np.angle(truth)))
    assert np.mean(np.abs(turn) < 2 * data["relative_deviation_1"]) > 0.85


def test_the_step_shows_the_delay_of_the_stage(figures):
    drawing = figures["step"]
    assert "delay 3 samples of 20 µs" in drawing.alternative
    before = drawing.data["time_s"] < 3 * 2e-5 - 1e-9
    assert np.all(np.abs(drawing.data["predicted_m_per_V"][before]) < 1e-9)


def test_the_delay_is_drawn_on_the_axis_of_the_step_whatever_its_unit(signal):
    period = 1e-4
    u = np.where(np.arange(20_000) // 2000 % 2, 5.0, 0.0)
    y = 1e-6 * np.roll(u, 3) + 1e-9 * signal.normal(size=u.size)
    y[:3] = 0.0
    (onset, _) = step(compare(Experiment((Record(u, y, period, phase="step"),)))).figure.get_axes()
    (line,) = [line for line in onset.get_lines() if str(line.get_label()).startswith("delay")]
    assert onset.get_xlabel() == "time since the edge [ms]"
    assert line.get_xdata()[0] == pytest.approx(0.3)


def test_the_spectrum_of_a_white_residual_is_flat_at_its_density(signal):
    period, sigma = 1e-3, 5e-9
    u = 5 - 5 * np.cos(2 * np.pi * 0.5 * period * np.arange(40_000))
    model = linear(period)
    bare = Record(u, np.zeros(u.size), period)
    record = Record(u, model.simulate(bare)[0] + sigma * signal.normal(size=u.size), period)
    data = residual_spectrum(compare(Experiment((record,)), {"model": model})).data
    assert np.median(data["residual_m_per_rtHz_1ms"]) == pytest.approx(sigma * np.sqrt(2 * period), rel=0.05)
    assert data["white_noise_m_per_rtHz_1ms"][0] == pytest.approx(sigma * np.sqrt(2 * period), rel=0.1)


def test_the_map_finds_a_static_nonlinearity_over_the_drive(signal):
    period = 1e-3
    u = 5 - 5 * np.cos(2 * np.pi * np.arange(20_000) * period / 2)
    model = linear(period)
    bare = Record(u, np.zeros(u.size), period)
    bend = 1e-8 * (u - 5) ** 2
    record = Record(u, model.simulate(bare)[0] + bend, period)
    data = residual_maps(compare(Experiment((record,)), {"model": model})).data
    for way in ("rising", "falling"):
        centre, mean = data[f"drive_V_{way}"], data[f"residual_m_over_drive_V_{way}"]
        assert mean - mean.mean() == pytest.approx(1e-8 * ((centre - 5) ** 2 - np.mean((centre - 5) ** 2)), abs=5e-9)


def test_the_gap_closes_when_the_missing_effect_is_added(comparison, figures):
    data = figures["gap"].data
    assert np.all(data["error_percent_of_range"] < data["error_before_percent_of_range"])
    assert list(data["phase"]) == [r.phase for r in comparison.experiment]


def test_the_residual_test_detects_a_dependence_on_the_drive(signal):
    u = signal.normal(size=20_000)
    record = Record(u, 1e-5 * np.roll(u, 1) + 1e-6 * np.roll(u, 9), 1e-3, phase="noise")
    drawing = whiteness(compare(Experiment((record,)), {"model": linear(1e-3)}))
    assert "depends on the drive" in drawing.alternative
    assert drawing.data["cross_lag_s"][np.argmax(np.abs(drawing.data["cross"]))] == pytest.approx(9e-3)


def test_a_window_of_a_fast_phase_contains_the_largest_residual():
    u = np.sin(2 * np.pi * np.arange(10_000) / 50)
    residual = np.zeros(u.size)
    residual[6000] = 1.0
    part = window(Record(u, u, 1e-4), residual)
    assert part.start <= 6000 < part.stop
    assert part.stop - part.start < 1000
    slow = Record(u[:200], u[:200], 1e-4)
    assert window(slow, residual[:200]) == slice(0, 200)


def test_against_time_shows_every_phase_of_a_short_experiment(comparison, figures):
    words = figures["time_series"].alternative
    assert all(r.phase in words for r in comparison.experiment)


@given(arrays(np.float64, st.integers(1, 5000), elements=st.floats(-1e3, 1e3)))
def test_thinning_keeps_ends_and_extremes(values):
    kept = thinned(values, 100)
    assert kept.size <= 100 or values.size <= 100
    assert {0, values.size - 1} <= set(kept.tolist())
    assert values[kept].max() == values.max()
    assert values[kept].min() == values.min()
    assert np.all(np.diff(kept) > 0)


def test_one_frequency_does_not_decide_the_residual_test():
    u = 5 + 4 * np.sin(2 * np.pi * np.arange(4000) / 200)
    record = Record(u, 1e-5 * np.roll(u, 1) + 1e-7 * np.roll(u, 40), 1e-3, phase="sine_5hz")
    drawing = whiteness(compare(Experiment((record,)), {"model": linear(1e-3)}))
    assert "may or may not depend on the drive" in drawing.alternative
    assert "does not depend" not in drawing.alternative


def test_bode_of_a_sweep_reaches_from_end_to_end(signal):
    period, pole = 1e-3, 0.7
    t = period * np.arange(8000)
    rate = np.log(200.0) / 8.0
    u = np.concatenate((np.zeros(200), np.sin(2 * np.pi * np.expm1(rate * t) / rate), np.zeros(200)))
    y = 1e-6 * lfilter([0.0, 1 - pole], [1.0, -pole], u) + 1e-9 * signal.normal(size=u.size)
    data = bode(compare(Experiment((Record(u, y, period, phase="chirp"),)))).data
    f = data["frequency_Hz_1"]
    assert f[0] < 5.0
    assert f[-1] > 150.0
    z = np.exp(2j * np.pi * f * period)
    truth = 1e-6 * (1 - pole) / (1 - pole / z) / z
    assert data["gain_m_per_V_1"] == pytest.approx(np.abs(truth), rel=0.03)
