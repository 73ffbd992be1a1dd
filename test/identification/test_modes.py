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

"""Modes far below the sampling rate are found under noise, where least squares of the ARX sees others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.steps.dynamics import identify_arx
from piezo_hysteresis.identification.steps.linear_start import ITERATIONS
from piezo_hysteresis.identification.steps.modes import identify_modes

from .test_dynamics import poles

PERIOD = 2e-5
NOISE = 5e-4
PLANTS = [
    ((260.0, 0.08, 1.0), (507.0, 0.043, 0.14), (976.0, 0.022, 0.09)),
    ((335.0, 0.09, 1.0), (455.0, 0.065, 0.15), (564.0, 0.076, 0.08), (1070.0, 0.06, 0.05)),
    ((172.0, 0.07, 1.0), (344.0, 0.023, 0.09), (525.0, 0.05, -0.06), (813.0, 0.05, 0.06)),
]


def answer(drive, modes):
    """Sum of modes of frequency [Hz], damping ratio and static gain."""
    y = np.zeros(drive.size)
    for frequency, damping, gain in modes:
        feedback = poles(frequency, damping)
        y += gain * lfilter([0.0, feedback.sum()], feedback, drive)
    return y


def recorded(modes, seed=0):
    random = np.random.default_rng(seed)
    drive = np.concatenate((np.zeros(10), 0.1 * np.repeat(random.standard_normal(6000), 10)))
    return drive, answer(drive, modes) + NOISE * random.standard_normal(drive.size)


def frequencies(dynamics):
    poles = np.roots(np.concatenate(([1.0], dynamics.arx.array("a"))))
    return np.abs(np.log(poles[poles.imag > 0.0])) / (2 * np.pi * PERIOD)


@pytest.mark.parametrize("modes", PLANTS)
def test_all_modes_are_found_under_noise(modes):
    found = identify_modes([recorded(modes)], 1, PERIOD, (8, 8), ITERATIONS)
    assert found.free_run_error == pytest.approx(NOISE, rel=0.1)
    for frequency, _, _ in modes:
        assert np.abs(frequencies(found) / frequency - 1.0).min() < 0.01


@pytest.mark.parametrize("modes", PLANTS[1:])
def test_four_modes_are_more_accurate_than_with_least_squares_of_the_arx(modes):
    drive, y = recorded(modes)
    clean = answer(drive, modes)

    def error(dynamics):
        return np.std(dynamics.simulate(drive) - clean)

    at_full_rate = identify_arx([(drive, y)], 1, PERIOD, (8, 8), ITERATIONS)
    assert error(at_full_rate) > 3 * error(identify_modes([(drive, y)], 1, PERIOD, (8, 8), ITERATIONS))


@settings(max_examples=30)
@given(frequency=st.floats(80.0, 3000.0), damping=st.floats(0.01, 0.3), seed=st.integers(0, 99))
def test_one_mode_is_known_to_a_hundredth(frequency, damping, seed):
    found = identify_modes([recorded([(frequency, damping, 1.0)], seed)], 1, PERIOD, (4, 4), ITERATIONS)
    band = np.array([0.0, 0.5, 1.0]) * frequency
    feedback = poles(frequency, damping)
    z = np.exp(-2j * np.pi * band * PERIOD)
    exact = feedback.sum() * z / np.polyval(feedback[::-1], z)
    np.testing.assert_allclose(found.response(band), exact, rtol=0.02)


def test_offsets_of_records_have_no_influence():
    signals = [(u, y + 3.0 * k) for k, (u, y) in enumerate([recorded(PLANTS[0], 0), recorded(PLANTS[0], 1)])]
    assert identify_modes(signals, 1, PERIOD, (8, 8), ITERATIONS).free_run_error == pytest.approx(NOISE, rel=0.1)


def test_a_record_too_short_for_a_lower_rate_is_refused():
    drive, y = recorded(PLANTS[0])
    with pytest.raises(IdentificationError, match="expected"):
        identify_modes([(drive[:150], y[:150])], 1, PERIOD, (8, 8), ITERATIONS)
