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

"""ARX by least squares recovers the published dynamics, and the noise bias of plain least squares is removed."""

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.published_plant import A_Z, B_Z, DELAY, SAMPLE_PERIOD, STROKE, hysteresis_output, linear_output
from piezo_hysteresis.effects import Arx
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.protocol import protocol
from piezo_hysteresis.identification.steps.dynamics import Dynamics, best_arx, identify_arx
from piezo_hysteresis.identification.steps.frequency_response import periodic, welch
from piezo_hysteresis.identification.steps.linear_start import ITERATIONS
from piezo_hysteresis.identification.steps.order_choice import choose_order, compare_orders

PUBLISHED = Dynamics(Arx(a=A_Z[1:], b=B_Z, delay=DELAY), SAMPLE_PERIOD)
BAND = np.geomspace(1.0, 2000.0, 60)
W = next(hysteresis_output(p.voltage) for p in protocol.short() if p.name == "noise")
Y = linear_output(W)


def noisy(level, seed=0):
    return [(W, Y + level * STROKE * np.random.default_rng(seed).standard_normal(Y.size))]


def test_published_coefficients_give_the_published_figures():
    assert PUBLISHED.arx.dc_gain == pytest.approx(0.24641, abs=5e-6)
    assert PUBLISHED.lag / SAMPLE_PERIOD - DELAY == pytest.approx(1.925, abs=5e-4)
    assert PUBLISHED.lag == pytest.approx(98.5e-6, abs=5e-8)
    assert np.angle(PUBLISHED.response(np.array([400.0, 1000.0])), deg=True) == pytest.approx([-14.18, -35.4], abs=0.05)
    assert PUBLISHED.arx.pole_radius == pytest.approx(0.9706, abs=5e-5)


def test_exact_from_exact_data():
    model = identify_arx([(W, Y)], DELAY, SAMPLE_PERIOD)
    np.testing.assert_allclose(model.arx.array("a"), A_Z[1:], atol=1e-7)
    np.testing.assert_allclose(model.arx.array("b"), B_Z, atol=1e-9)
    assert model.free_run_error < 1e-10


def test_records_with_different_offsets_are_fitted_together():
    half = W.size // 2
    model = identify_arx([(W[:half], Y[:half] + 0.3), (W[half:], Y[half:] - 5.0)], DELAY, SAMPLE_PERIOD)
    np.testing.assert_allclose(model.response(BAND), PUBLISHED.response(BAND), rtol=1e-5)


def test_iterations_remove_the_bias_of_the_sensor_noise():
    truth = Dynamics(Arx(a=(-1.5, 0.7), b=(0.1, 0.1), delay=2), 1.0)
    random = np.random.default_rng(0)
    u = random.standard_normal(40_000)
    clean = truth.simulate(u)
    y = clean + 0.3 * np.std(clean) * random.standard_normal(u.size)

    def largest_error(iterations):
        model = identify_arx([(u, y)], 2, 1.0, (2, 2), iterations)
        frequency = np.linspace(0.01, 0.2, 50)
        return np.abs(model.response(frequency) / truth.response(frequency) - 1.0).max()

    assert largest_error(0) > 0.2
    assert largest_error(6) < 0.03


@pytest.mark.parametrize("seed", range(3))
def test_iterations_find_weak_and_lightly_damped_modes_last(seed):
    random = np.random.default_rng(seed)
    drive = 0.04 * random.standard_normal(30_000)
    y = 5e-4 * random.standard_normal(drive.size)
    for frequency, damping, weight in ((300.0, 0.01, 0.8), (690.0, 0.008, 0.15), (1230.0, 0.008, 0.05)):
        mode = poles(frequency, damping)
        y += weight * lfilter([0.0, mode.sum()], mode, drive)

    def error(iterations):
        return identify_arx([(drive, y)], 1, SAMPLE_PERIOD, (8, 8), iterations).free_run_error

    assert error(ITERATIONS) < 0.5 * error(3)


def poles(frequency, damping):
    pole = np.exp(2 * np.pi * frequency * SAMPLE_PERIOD * (-damping + 1j * np.sqrt(1 - damping**2)))
    return np.real(np.poly([pole, np.conj(pole)]))


def test_few_and_many_iterations_in_one_run_give_the_models_of_two_runs():
    few, many = best_arx(noisy(2e-3), DELAY, SAMPLE_PERIOD, (2, 3), (0, ITERATIONS))
    for model, iterations in ((few, 0), (many, ITERATIONS)):
        assert model.arx == identify_arx(noisy(2e-3), DELAY, SAMPLE_PERIOD, (2, 3), iterations).arx
    assert len(best_arx([(W, Y)], DELAY, SAMPLE_PERIOD, (8, 8), (0, 0))) == 1


def test_a_noisy_record_gives_a_start_good_to_0_3_percent():
    model = identify_arx(noisy(0.0005), DELAY, SAMPLE_PERIOD, iterations=10)
    assert np.abs(model.response(BAND) / PUBLISHED.response(BAND) - 1.0).max() < 3e-3


def test_error_against_order_flattens_where_the_plant_ends():
    table = compare_orders(noisy(0.0005), DELAY, SAMPLE_PERIOD, highest=10)
    assert table[0].free_run_error > 5 * table[7].free_run_error
    assert 3 <= choose_order(table) <= 8
    assert all(row.one_step_error > 0 for row in table)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("integrations", [2, 4, 6])
@pytest.mark.parametrize("orders", [(4, 2), (8, 8)])
def test_the_result_is_stable_even_when_least_squares_is_not(seed, integrations, orders):
    random = np.random.default_rng(seed)
    u, y = random.standard_normal(2000), random.standard_normal(2000)
    for _ in range(integrations):
        y = np.cumsum(y)
    assert identify_arx([(u, y / np.std(y))], 1, 1.0, orders, ITERATIONS).arx.pole_radius < 1.0


@pytest.mark.parametrize(
    ("signals", "orders"),
    [([(np.zeros(100), np.ones(100))], (2, 2)), ([(np.arange(5.0), np.arange(5.0))], (8, 8)), ([(W, Y)], (2, 0))],
)
def test_data_that_cannot_be_fitted_are_refused(signals, orders):
    with pytest.raises(IdentificationError, match="expected"):
        identify_arx(signals, DELAY, SAMPLE_PERIOD, orders)


def test_welch_agrees_with_the_model_within_its_own_deviation():
    u = np.random.default_rng(2).standard_normal(200_000)
    y = linear_output(u) + 0.02 * np.random.default_rng(3).standard_normal(u.size)
    estimate = welch([(u, y)], SAMPLE_PERIOD, 2048)
    inside = (estimate.frequency > 100.0) & (estimate.frequency < 5000.0)
    error = estimate.value[inside] / PUBLISHED.response(estimate.frequency[inside]) - 1.0
    spread = np.std(np.concatenate((error.real, error.imag)) / np.tile(estimate.deviation[inside], 2))
    assert 0.8 < spread < 1.3


def test_periodic_average_has_no_leakage():
    phase = next(p for p in protocol.short() if p.name == "multisine")
    period = round(0.1 / SAMPLE_PERIOD)
    start = np.argmax(np.abs(np.diff(phase.voltage, 2)) > 1e-3)
    w = phase.voltage[start : start + 4 * period]
    estimate = periodic(w, linear_output(w), SAMPLE_PERIOD, period)
    np.testing.assert_allclose(estimate.value, PUBLISHED.response(estimate.frequency), rtol=1e-4)
    assert estimate.coherence.min() > 0.99
