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

"""The model as a value: order, names, scales, and what it refuses."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.effects import (
    Arx,
    AsymmetricHysteresis,
    BoucWen,
    Creep,
    ExtraResonance,
    Offset,
    SensorBandwidth,
    SensorNonlinearity,
    ThermalDrift,
    ThermalExpansion,
    effect_named,
)
from piezo_hysteresis.errors import ModelError, ParameterError, RecordError, UnknownStateWarning
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.sample_periods import KEPT_CHAINS, identified_periods
from piezo_hysteresis.record import Record

PERIOD = 1e-3
MODEL = Model((Arx(a=[-0.5], b=[0.5]), BoucWen()), PERIOD, displacement_scale=1e-5)


def test_effects_stand_in_the_order_of_physics() -> None:
    model = MODEL
    for effect in (Offset(), ThermalDrift(D=1e-7), SensorNonlinearity(), Creep(), AsymmetricHysteresis()):
        model = model.with_effect(effect)
    assert [e.name for e in model.effects] == [
        "bouc_wen",
        "asymmetric_hysteresis",
        "creep",
        "arx",
        "sensor_nonlinearity",
        "thermal_drift",
        "offset",
    ]


def test_with_and_without_return_new_models() -> None:
    more = MODEL.with_effect(Creep(gamma=0.01))
    assert "creep" in more
    assert "creep" not in MODEL
    assert more.with_effect(Creep(gamma=0.02))["creep"]["gamma"] == 0.02
    assert more.without("creep").values() == MODEL.values()


def test_numbers_are_named_and_changed_by_name() -> None:
    changed = MODEL.with_values({"arx.b[0]": 0.25, "bouc_wen.A": -0.5})
    assert changed.values()["arx.b[0]"] == 0.25
    assert changed["bouc_wen"]["A"] == -0.5
    assert MODEL.values()["arx.b[0]"] == 0.5
    assert MODEL.row("arx.b[0]").unit == "1"
    assert MODEL.effect(Arx)["delay"] == MODEL["arx"]["delay"]


def test_the_scales_are_part_of_the_model() -> None:
    u = 5.0 + np.sin(np.arange(100) / 9.0)
    y, _ = MODEL.run(u, MODEL.rest(u[0]))
    doubled = Model(MODEL.effects, PERIOD, voltage_scale=20.0, displacement_scale=3e-5)
    np.testing.assert_allclose(doubled.run(2 * u, doubled.rest(2 * u[0]))[0], 3 * y, rtol=1e-12)


def test_a_lag_is_the_same_at_every_sample_period() -> None:
    """Samples of 100 µs of a model that has 1 µs only because its fastest record had."""
    lag = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=300.0)), 1e-6, provenance=identified_periods((1e-6, 1e-4)))
    u = 5.0 - 5.0 * np.cos(2 * np.pi * 50.0 * 1e-4 * np.arange(400))
    (wanted,) = lag.simulate(Record(u, u, 1e-4))
    y, state = lag.run(u[:100], lag.rest(0.0, sample_period=1e-4))
    y = np.concatenate((y, lag.run(u[100:], state)[0]))
    np.testing.assert_array_equal(y, wanted)
    np.testing.assert_array_equal(lag.simulate(u, sample_period=1e-4), wanted)
    assert np.abs(lag.simulate(u, sample_period=1e-6) - wanted).max() > 0.05 * np.ptp(wanted)
    for ask in (lag.rest, lambda _: lag.simulate(u)):
        with pytest.raises(ModelError, match=r"of the samples; the model was identified at 1e-06, 0.0001"):
            ask(0.0)
    with pytest.raises(ModelError, match="expected 1e-06 s"):
        lag.rest(0.0, sample_period=1e-7)


def test_a_run_continues_at_another_sample_period_with_its_state() -> None:
    _, before = MODEL.run(np.linspace(0.0, 8.0, 200), MODEL.rest(0.0))
    settled, _ = MODEL.run(np.full(500, 8.0), before)
    held, state = MODEL.run(np.full(50, 8.0), before, sample_period=1e-2)
    assert state.sample_period == 1e-2
    np.testing.assert_allclose(held, settled[-1], rtol=1e-12)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Model((BoucWen(), BoucWen()), PERIOD), "'bouc_wen' is in the chain twice"),
        (lambda: Model((Arx(), AsymmetricHysteresis()), PERIOD), "'asymmetric_hysteresis' needs 'bouc_wen'"),
        (lambda: Model((Arx(),), 0.0), "sample_period: got 0.0, expected a positive"),
        (lambda: Model((Arx(),), PERIOD, voltage_scale=-1.0), "voltage_scale: got -1.0"),
        (lambda: Model((Arx(),), PERIOD, displacement_scale=float("nan")), "displacement_scale: got nan"),
        (lambda: MODEL["creep"], "no effect 'creep' in the chain bouc_wen, arx"),
        (lambda: MODEL.effect(Creep), "no effect 'creep'"),
        (lambda: MODEL.effect("arx"), "got 'arx', expected a class"),
        (lambda: MODEL.at(PERIOD / 2), "expected 0.001 s .* or more; decimate"),
        (lambda: MODEL.run([], MODEL.rest(0.0)), "voltage: got shape"),
        (lambda: MODEL.run([[1.0]], MODEL.rest(0.0)), "voltage: got shape"),
        (lambda: MODEL.run([1.0, float("inf")], MODEL.rest(0.0)), "voltage: sample 1 is not finite"),
        (lambda: Model((BoucWen,), PERIOD), r"effects: got <class .*BoucWen'>, expected effects, e.g. BoucWen\(\)"),
        *((lambda p=p: MODEL.rest(0.0, sample_period=p), "sample period: got") for p in (0.0, np.nan, np.inf, -1.0)),
        (lambda: MODEL.run([1.0], MODEL.rest(0.0), sample_period=0.0), "sample period: got 0 s"),
        (lambda: MODEL.run([1.0], MODEL.without("arx").rest(0.0)), "state: got one of another model"),
        (
            lambda: MODEL.run([1.0], MODEL.without("arx").with_effect(Creep()).rest(0.0)),
            "state: got one of another model",
        ),
        (lambda: MODEL.run(["a"], MODEL.rest(0.0)), "voltage: got list, expected one dimension of real numbers"),
        (lambda: MODEL.run([[1.0], [1.0, 2.0]], MODEL.rest(0.0)), "voltage: got list, expected one dimension"),
        (lambda: MODEL.run(np.array([1j]), MODEL.rest(0.0)), "voltage: got ndarray, expected one dimension of real"),
        *(
            (lambda n=n: MODEL.with_values({n: 1.0}), f"no number '{re.escape(n)}', expected one of")
            for n in ("arx.b[7]", "bouc_wen.A[0]", "arx.q[0]", "bouc_wen.q", "arx.b[0", "arx.b[-1]")
        ),
        (lambda: MODEL.row("bouc_wen.nope"), "no number 'bouc_wen.nope', expected one of A, beta"),
        (lambda: MODEL.sensitivities(Record([1.0], [1.0], PERIOD), ["nope"]), "no effect 'nope'"),
        (lambda: effect_named("crepe"), "unknown effect 'crepe', expected one of"),
    ],
)
def test_invalid_values_are_refused_in_one_line(build, message: str) -> None:
    with pytest.raises(ModelError, match=message) as raised:
        build()
    assert "\n" not in str(raised.value)


def test_unknown_and_impossible_numbers_are_refused() -> None:
    with pytest.raises(ParameterError, match="unknown parameter 'gama'"):
        Creep(gama=0.1)
    with pytest.raises(ParameterError, match=r"arx\.b: got an array parameter"):
        MODEL["arx"]["b"]
    with pytest.raises(ParameterError, match=r"creep\.gamma: got 3 1/decade, expected -0\.2 to 0\.2"):
        Creep(gamma=3.0)


@pytest.mark.parametrize(
    ("name", "samples", "message"),
    [
        ("temperature", [293.0], "temperature: got 1 samples, expected 3"),
        ("temperature", [293.0, np.nan, 293.0], "temperature: sample 1 is nan"),
        ("temprature", [293.0] * 3, "got the name 'temprature'"),
    ],
)
def test_channels_are_checked_as_those_of_a_record(name: str, samples: list[float], message: str) -> None:
    model = MODEL.with_effect(ThermalExpansion(kappa=1e-7))
    with pytest.raises(RecordError, match=message):
        model.run([0.0, 1.0, 2.0], model.rest(0.0), {name: samples})
    y, _ = model.run([0.0, 1.0, 2.0], model.rest(0.0), {"temperature": [293.0, 294.0, 295.0]})
    assert np.ptp(y - model.simulate([0.0, 1.0, 2.0])) > 1e-8


def test_creep_continues_between_continuing_records() -> None:
    model = MODEL.with_effect(Creep(gamma=0.02, tau_min=1e-3, tau_max=1e3))
    drive = np.concatenate((np.linspace(0.0, 5.0, 200), np.full(4800, 5.0), np.linspace(5.0, 2.0, 300)))
    whole = Record(drive, drive, PERIOD)
    parts = [whole[:200], whole[5000:]]
    expected = model.simulate(whole)[0][5000:]
    behind = model.simulate(parts)[1]
    np.testing.assert_allclose(behind, expected, atol=1e-5 * np.ptp(expected))
    (_, _, y, _, (slope,)), *_ = list(model.linearise(parts, ["creep.gamma"]))[1:]
    np.testing.assert_array_equal(y, behind)
    np.testing.assert_allclose(slope, model.sensitivities(whole, ["creep.gamma"])[1]["creep.gamma"][5000:], rtol=1e-3)


RESONANT = Model((BoucWen(), ExtraResonance(r=0.2, f0=100.0, zeta=0.02)), PERIOD, displacement_scale=1e-5)


@pytest.mark.parametrize("missing", [0, 1, 5, 40])
@pytest.mark.parametrize("drift", [0.0, 1e-12, 1e-4])
def test_a_short_gap_and_the_last_digits_of_a_period_leave_the_dynamics_as_they_are(missing: int, drift: float) -> None:
    """The stage rings while the drive is held."""
    drive = np.concatenate((np.zeros(50), np.full(250, 5.0)))
    (expected,) = RESONANT.simulate(Record(drive, drive, PERIOD))
    first = Record(drive[:60], drive[:60], PERIOD * (1.0 + drift), start_time=0.3)
    behind = slice(60 + missing, None)
    start = first.start_time + first.duration + missing * PERIOD
    second = Record(drive[behind], drive[behind], PERIOD, start_time=start, continues=True)
    np.testing.assert_array_equal(RESONANT.simulate([first, second])[1], expected[behind])
    for index, _, y, _, _ in RESONANT.linearise([first, second], ["extra_resonance.r"]):
        np.testing.assert_array_equal(y, (expected[:60], expected[behind])[index])


def test_slow_records_whose_periods_differ_in_the_last_digits_continue() -> None:
    slow = Record(np.cos(np.arange(90.0) / 9.0), np.zeros(90), 7e-3)
    model = RESONANT.with_effect(SensorBandwidth(tau=2e-2))
    second = replace(slow[50:], sample_period=7e-3 * (1.0 + 1e-12))
    np.testing.assert_array_equal(model.simulate([slow[:50], second])[1], model.simulate(slow)[0][50:])


def test_a_model_keeps_a_bounded_number_of_chains() -> None:
    model = Model((Arx(),), PERIOD)
    for period in np.linspace(2.0, 9.0, 100) * PERIOD:
        model.at(period)
    assert len(model._chains) == KEPT_CHAINS


def test_a_part_of_an_experiment_keeps_the_state_or_warns():
    whole = Record(5.0 - 5.0 * np.cos(np.arange(3000.0) / 300.0), np.zeros(3000), PERIOD, phase="triangle")
    first, second = whole.split(1500)
    second = replace(second, phase="validation")
    (carried,) = MODEL.simulate([first, second], phase="validation")
    np.testing.assert_array_equal(carried, MODEL.simulate(whole)[0][1500:])
    with pytest.warns(UnknownStateWarning, match="'validation' continues one that was not given"):
        (alone,) = MODEL.simulate(second)
    assert np.ptp(alone - carried) > 1e-9
    with pytest.raises(ModelError, match="expected one of triangle, validation"):
        MODEL.simulate([first, second], phase="sine")


def test_simulate_takes_a_voltage():
    drive = 5.0 - 5.0 * np.cos(np.arange(300.0) / 30.0)
    expected = MODEL.simulate(Record(drive, drive, MODEL.sample_period))[0]
    np.testing.assert_array_equal(MODEL.simulate(drive), expected)
    np.testing.assert_array_equal(MODEL.simulate(drive.tolist()), expected)
