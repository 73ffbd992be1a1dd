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

"""What recalibration says of a lag, the model that it writes has, and no model is earlier than one without a delay."""

import numpy as np
import pytest

from piezo_hysteresis.changes.change_kinds import KINDS
from piezo_hysteresis.changes.recalibration import recalibrate
from piezo_hysteresis.changes.signatures import delay_of, shaped_model
from piezo_hysteresis.effects import Arx, BoucWen, ExtraDelay, SecondOrderLowPass, SensorBandwidth
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 1e-4


def model(samples, extra=None, gain=1.0):
    """A stage with a delay [samples] in its dynamics and an extra one [samples]."""
    dynamics = (BoucWen(), Arx(a=[-1.2, 0.5], b=[0.2, 0.1], delay=samples))
    effects = dynamics if extra is None else (*dynamics, ExtraDelay(tau=extra * PERIOD))
    return Model(effects, PERIOD, 10.0, 1e-5 * gain)


def played(stage, earlier=0):
    """Sines of three rates, measured so many samples earlier than the stage responds."""
    rng, records = np.random.default_rng(0), []
    for frequency in (5.0, 40.0, 150.0):
        drive = 4.0 * (1.0 - np.cos(2.0 * np.pi * frequency * PERIOD * np.arange(8000 + earlier)))
        y = stage.simulate(drive)[earlier:]
        records.append(Record(drive[:8000], y + 2e-9 * rng.standard_normal(y.size), PERIOD))
    return Experiment(tuple(records))


@pytest.mark.parametrize(
    ("old", "stage", "late"),
    [
        (model(4, 0.2), model(3, 0.2, 1.01), -1.0),
        (model(4, 0.2), model(4, 1.0, 1.01), 0.8),
        (model(4), model(3, gain=1.01), -1.0),
        (model(2.5), model(4, gain=1.01), 1.5),
    ],
)
def test_the_recalibrated_model_has_the_lag_that_is_said(old, stage, late):
    """A model with an extra delay kept its other one, and was five times less earlier than was said."""
    found = recalibrate(old, played(stage))
    low, high = found.intervals_95["lag"]
    assert low <= late * PERIOD <= high
    assert delay_of(found.model) - delay_of(old) == pytest.approx(found.lag, abs=1e-12)
    assert found.after < 0.2 * found.before


def test_no_lag_is_said_that_no_model_has():
    """The displacement is earlier than without any delay: it was said to be, and the model was not."""
    old = model(0.5)
    found = recalibrate(old, played(model(0.0, gain=1.01), earlier=1))
    assert found.lag >= -delay_of(old)
    assert delay_of(found.model) - delay_of(old) == pytest.approx(found.lag, abs=1e-12)


@pytest.mark.parametrize("late", [-4.2, -1.0, -0.2, 0.7])
def test_a_later_model_is_later_by_what_was_asked(late):
    old = model(4, 0.2)
    assert delay_of(shaped_model(old, "delay", late * PERIOD)) == pytest.approx(delay_of(old) + late * PERIOD)


@pytest.mark.parametrize("key", ["low_pass", "low_pass_2", "low_pass_poles"])
@pytest.mark.parametrize("before", [(), (SensorBandwidth(tau=3e-4, poles=3), SecondOrderLowPass(tau=5e-4, zeta=0.5))])
def test_a_low_pass_makes_a_model_later_by_its_own_lag(key, before):
    """A filter of another form replaced the one that the model had, and the model became earlier."""
    old, step = model(4), 5.0 * (np.arange(2000) > 0)
    for effect in before:
        old = old.with_effect(effect)
    y, later = (m.simulate(step) for m in (old, shaped_model(old, key, 5e-4)))
    assert PERIOD * np.sum(y - later) / y[-1] == pytest.approx(KINDS[key].lag * 5e-4, rel=1e-6)


def test_a_model_earlier_than_its_delay_is_refused():
    with pytest.raises(ParameterError, match="delay"):
        shaped_model(model(1.0), "delay", -3.0 * PERIOD)
