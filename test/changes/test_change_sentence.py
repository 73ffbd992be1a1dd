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

"""What the sentence of a change says of a filter is so."""

import re

import numpy as np
import pytest

from piezo_hysteresis.changes.change_kinds import KINDS, ParameterChange
from piezo_hysteresis.changes.change_sentence import sentence_of


@pytest.mark.parametrize("key", [key for key, kind in KINDS.items() if kind.is_filter])
def test_a_filter_halves_the_power_at_the_cut_off_frequency_that_is_said(key):
    """The natural frequency was said: 1.56 times the cut-off frequency for two equal poles, 1.27 times for Bessel."""
    tau = 2e-4
    said = sentence_of(ParameterChange(key, tau, (0.9 * tau, 1.1 * tau), (), 9.0, 1.0, {}))
    (number,) = re.findall(r"cut-off frequency ([0-9.e+]+) Hz", said)
    s = 2j * np.pi * float(number) * tau
    zeta = KINDS[key].damping
    response = 1.0 / (1.0 + 2.0 * zeta * s + s * s) if zeta else 1.0 / (1.0 + s)
    assert abs(response) ** 2 == pytest.approx(0.5, rel=1e-3)
