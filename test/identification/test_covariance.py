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

"""Covariance of a joint fit: of the size that theory asks for, and never negative."""

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD, NOISE = 1e-3, 1e-8
LOOP = BoucWen(A=0.4, beta=3.0, gamma=0.5, p1=0.0, p2=1.0)


def recorded(model, seed):
    rng = np.random.default_rng(seed)
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 0.5 * PERIOD * np.arange(6000))
    clean = model.simulate([Record(drive, np.zeros(drive.size), PERIOD)])[0]
    return Record(drive, clean + NOISE * rng.normal(size=drive.size), PERIOD)


def test_the_error_of_a_zero_is_that_of_a_mean():
    model = Model((LOOP, Arx(a=(), b=(1.0,), delay=1), Offset()), PERIOD, 10.0, 1e-5)
    record = recorded(model, 1)
    found = fit(model, [record], ("offset.y0",))
    assert found.standard_errors["offset.y0"] == pytest.approx(NOISE / np.sqrt(record.size), rel=0.05)


def test_no_variance_is_negative_where_poles_cancel_zeros():
    cancelling = np.polymul([1.0, -0.5], [1.0, -0.7])
    arx = Arx(a=tuple(cancelling[1:]), b=tuple(0.5 * np.array([1.0, -0.7, 0.0])), delay=1)
    model = Model((LOOP, arx, Offset()), PERIOD, 10.0, 1e-5)
    names = [n for n in model.values() if n not in ("arx.delay", "offset.settling")]
    found = fit(model, [recorded(model, 2)], names, max_iterations=3)
    assert np.linalg.eigvalsh(found.covariance).min() >= -1e-12 * np.abs(found.covariance).max()
    assert all(np.isfinite(error) and error >= 0.0 for error in found.standard_errors.values())
    assert found.standard_errors["bouc_wen.beta"] > 0.0
