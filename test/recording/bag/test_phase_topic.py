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

"""Messages of the topic `phase` are a number and a name; others are refused, so that the reader counts them."""

import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording.bag.phase_topic import PhaseNames


def test_a_number_gets_the_name_that_was_given_nearest_in_time():
    names = PhaseNames()
    for received, number, name in ((0, 1, "step"), (10, 2, "sine_50hz"), (100, 1, "noise")):
        names.add(PhaseNames.to_cdr(number, name), received)
    assert (names.at(1, 20), names.at(2, 20), names.at(1, 90), names.at(3, 0)) == ("step", "sine_50hz", "noise", None)


@pytest.mark.parametrize(("number", "name"), [("", ""), (12, ""), ("x", "y"), (-1, "rest"), ("²", "rest")])
def test_another_text_is_refused(number, name):
    with pytest.raises(RecordingError, match="expected a number and a name"):
        PhaseNames().add(PhaseNames.to_cdr(number, name), 0)
