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

"""The joint identification returns the published model from its own noisy data; the plain three steps do not."""

import numpy as np
import pytest

from benchmarks import recovery


@pytest.fixture(scope="module")
def results():
    return [recovery.recover(seed) for seed in range(3)]


def test_the_delay_is_exact(results):
    assert [r.delay for r in results] == [3, 3, 3]


def test_every_number_of_the_loop_is_found(results):
    assert np.max(np.abs([r.parameters for r in results])) < 0.5


def test_errors_agree_with_the_uncertainties(results):
    deviates = np.concatenate([r.deviates for r in results])
    assert 0.5 < np.sqrt(np.mean(deviates**2)) < 1.6


def test_the_frequency_response_is_found(results):
    assert max(r.gain for r in results) < 0.3
    assert max(r.phase for r in results) < 0.2


def test_free_run_matches_the_noise_free_truth(results):
    assert max(r.free_run for r in results) < 0.02


def test_noise_biases_the_published_three_steps(results):
    assert min(r.published_gain for r in results) > 20.0
    assert min(r.published_free_run for r in results) > 10 * max(r.free_run for r in results)
