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

"""What `identify` and `diagnose` accept, and how they refuse the rest."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.errors import IdentificationError, ParameterError, RecordError
from piezo_hysteresis.identification import identify
from piezo_hysteresis.identification.inputs import experiment_of
from piezo_hysteresis.record import Experiment, Record

FLAT = Record(np.full(100, 1.0), np.zeros(100), 1e-4)
"""A record in which nothing moves."""


@pytest.mark.parametrize("function", [identify, diagnose])
def test_records_are_taken_as_simulate_takes_them(function):
    for given in (FLAT, [FLAT], iter((FLAT, FLAT)), Experiment((FLAT,))):
        with pytest.raises(IdentificationError, match="drive does not move"):
            function(given)


@pytest.mark.parametrize("function", [identify, diagnose])
@pytest.mark.parametrize("given", ["an_experiment", None, 1.0, [0.0, 1.0], [], [FLAT, None]])
def test_what_is_no_record_is_refused(function, given):
    with pytest.raises(RecordError, match="experiment"):
        function(given)


def test_an_experiment_keeps_its_notices():
    whole = Experiment((FLAT,), source="here")
    assert experiment_of(whole) is whole


@pytest.mark.parametrize(
    "options",
    [
        {"voltage_scale": 0.0},
        {"voltage_scale": -1.0},
        {"displacement_scale": 0.0},
        {"displacement_scale": np.nan},
        {"gain": 0.0},
        {"gain": np.inf},
        {"hysteresis": BoucWen()},
        {"hysteresis": "bouc_wen"},
    ],
)
def test_scales_gain_and_operator_are_checked_first(options):
    with pytest.raises(ParameterError, match=next(iter(options))):
        identify(FLAT, **options)
