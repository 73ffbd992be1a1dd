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

"""Rules of the selection: what share of a gap is explained, and when the search stops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.discrepancy.search.candidate_refits import LEAST_GAIN, leaves_room
from piezo_hysteresis.discrepancy.search.selection import select
from piezo_hysteresis.discrepancy.search.selection_result import Selection, explained
from piezo_hysteresis.discrepancy.search.training_data import TrainingData
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.records.noise_floor import ADEQUATE


@given(null=st.floats(0.1, 1.5), gap=st.floats(1.0, 1e4), share=st.floats(0.0, 1.0))
def test_explained_is_the_removed_share_of_the_rms_error(null, gap, share):
    # the error beyond noise falls to (1 − share) of what it was: its power to (1 − share)²
    after = null + gap * (1 - share) ** 2
    assert explained(null + gap, after, null) == pytest.approx(share, abs=1e-6)


def test_explained_stays_between_nothing_and_all():
    assert explained(10.0, 20.0, 1.0) == 0.0
    assert explained(10.0, 0.5, 1.0) == 1.0
    assert explained(0.9, 0.9, 1.0) == 1.0


def test_nothing_is_tried_where_no_effect_can_gain_enough():
    score = Score(np.sqrt(np.exp(np.full(5, 0.99 * LEAST_GAIN))), np.empty(0))
    found = select(None, TrainingData((), np.ones(1), None, None), score)
    assert isinstance(found, Selection)
    assert found.steps == found.accepted == ()


def test_a_lag_in_a_few_records_leaves_room_although_their_mean_is_at_the_floor():
    """Slow records whose noise is below their floor; V alone ended the search."""
    ratios = np.sqrt(np.array([0.2] * 12 + [2.4] * 6))
    score = Score(ratios, np.empty(0))
    assert score.excess < ADEQUATE
    assert leaves_room(score)
    assert not leaves_room(Score(np.minimum(ratios, 1.0), np.empty(0)))
