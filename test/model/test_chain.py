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

"""State and sensitivities through the chain: over blocks, records and sample periods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects import (
    AmplifierBandwidth,
    AmplifierSlewLimit,
    Arx,
    AsymmetricHysteresis,
    Backlash,
    BoucWen,
    Creep,
    EvenInputPolynomial,
    ExtraDelay,
    ExtraResonance,
    GainDrift,
    HysteresisMemory,
    Offset,
    PublishedBoucWen,
    RateDependentHysteresis,
    SensorBandwidth,
    SensorNonlinearity,
    Softening,
    ThermalDrift,
)
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-4
EVERYTHING = Model(
    (
        AmplifierSlewLimit(S=2e4),
        AmplifierBandwidth(tau=5e-5),
        Backlash(b=0.01),
        BoucWen(),
        AsymmetricHysteresis(phi1=0.3, phi2=0.2),
        RateDependentHysteresis(k=0.03),
        HysteresisMemory(c=[0.02] * 4, reach=0.3),
        EvenInputPolynomial(p_e=0.02),
        Creep(gamma=0.02, tau_min=1e-4, tau_max=100.0),
        ExtraDelay(tau=1.3e-4),
        Arx(a=[-1.2, 0.6], b=[0.3, 0.1], delay=2.3),
        Softening(k2=-0.01, k3=0.01),
        ExtraResonance(r=0.05, f0=300.0, zeta=0.05),
        SensorNonlinearity(s2=0.01, s3=0.005),
        GainDrift(g=0.01, tau=2.0),
        SensorBandwidth(tau=3e-5, poles=2),
        ThermalDrift(D=1e-7, tau=2.0),
        Offset(y0=2e-8),
    ),
    PERIOD,
    displacement_scale=1e-5,
)
"""A chain in which every place is taken."""


def drive(n: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    return 3.5 + 2.5 * np.sin(np.arange(n) / 40.0) + rng.normal(scale=0.02, size=n)


def record(n: int = 600, period: float = PERIOD, **values) -> Record:
    return Record(drive(n), np.zeros(n), period, **values)


def slopes(model: Model, records: list[Record], names: list[str], block: int = 8192) -> dict[str, np.ndarray]:
    """∂y/∂θ over all records, one after the other."""
    parts = [dict(zip(order, s, strict=True)) for *_, order, s in model.linearise(records, names, block)]
    return {n: np.concatenate([p[n] for p in parts]) for n in names}


NAMES = [n for n in EVERYTHING.values() if not EVERYTHING.row(n).fixed]


@settings(max_examples=15)
@given(st.lists(st.integers(1, 599), min_size=1, max_size=5, unique=True).map(sorted))
def test_parts_that_continue_are_the_whole_record_bit_for_bit(cuts: list[int]) -> None:
    whole = record(start_time=0.7)
    np.testing.assert_array_equal(
        np.concatenate(EVERYTHING.simulate(whole.split(*cuts))), EVERYTHING.simulate(whole)[0]
    )


@pytest.mark.parametrize("block", [1, 7, 200])
def test_sensitivities_do_not_depend_on_blocks_or_parts(block: int) -> None:
    whole = record(300)
    expected = slopes(EVERYTHING, [whole], NAMES)
    for records in ([whole], whole.split(100, 101)):
        got = slopes(EVERYTHING, records, NAMES, block)
        for name in NAMES:
            np.testing.assert_array_equal(got[name], expected[name], err_msg=name)


def test_a_record_that_does_not_continue_starts_from_rest() -> None:
    first, second = record(200), record(300, initial_voltage=4.0)
    np.testing.assert_array_equal(EVERYTHING.simulate([first, second])[1], EVERYTHING.simulate(second)[0])
    continued = EVERYTHING.simulate([first, replace(second, continues=True)])[1]
    assert not np.array_equal(continued, EVERYTHING.simulate(second)[0])


def test_only_wanted_rows_are_carried() -> None:
    few = ["creep.gamma", "arx.a[1]", "bouc_wen.beta", "softening.k3"]
    every = slopes(EVERYTHING, [record(200)], NAMES)
    some = slopes(EVERYTHING, [record(200)], few)
    for name in few:
        np.testing.assert_allclose(some[name], every[name], rtol=1e-12, err_msg=name)


def test_without_wanted_rows_the_free_run_alone_is_computed() -> None:
    records = [*joined(), record(300, initial_voltage=4.0)]
    parts = list(EVERYTHING.linearise(records, (), 100))
    np.testing.assert_array_equal(
        np.concatenate([y for _, _, y, _, _ in parts]), np.concatenate(EVERYTHING.simulate(records))
    )
    assert all(names == () and rows.shape == (0, y.size) for _, _, y, names, rows in parts)


def joined() -> list[Record]:
    """A fast record and its slow continuation, with a hold between them."""
    fast = record(400)
    hold = np.full(400, fast.voltage[-1])
    fast = replace(fast, voltage=np.append(fast.voltage, hold), displacement=np.zeros(800))
    voltage = np.interp(np.arange(1, 81), [0, 40, 80], [hold[0], 5.0, 2.0])
    slow = Record(voltage, np.zeros(80), 1e-2, start_time=fast.duration, continues=True)
    return [fast, slow]


def test_memory_passes_to_a_record_at_another_sample_period() -> None:
    model = Model((BoucWen(), HysteresisMemory(c=[0.05] * 4), Arx(a=[-0.5], b=[0.5])), PERIOD)
    fast, slow = joined()
    path = np.concatenate((fast.voltage, slow.voltage))
    (whole,) = model.simulate(Record(np.repeat(path, 50), np.zeros(path.size * 50), PERIOD))
    expected = whole[49::50][fast.size :]
    np.testing.assert_allclose(model.simulate([fast, slow])[1][1:], expected[1:], atol=2e-3 * np.ptp(expected))
    fresh = model.simulate(replace(slow, continues=False))[0]
    assert np.abs(fresh - expected).max() > 0.02 * np.ptp(expected)


def test_sensitivities_pass_to_a_record_at_another_sample_period() -> None:
    names = [n for n in NAMES if n.partition(".")[0] not in ("amplifier_slew_limit", "backlash")]
    got = slopes(EVERYTHING, joined(), names)
    for name in names:
        at, h = EVERYTHING.values()[name], 1e-5 * EVERYTHING.row(name).scale
        up, down = (np.concatenate(EVERYTHING.with_values({name: at + step}).simulate(joined())) for step in (h, -h))
        expected = (up - down) / (2 * h)
        floor = 1e-9 * EVERYTHING.displacement_scale / EVERYTHING.row(name).scale
        np.testing.assert_allclose(
            got[name], expected, rtol=5e-4, atol=5e-5 * np.abs(expected).max() + floor, err_msg=name
        )


@pytest.mark.parametrize("start", [0, 60])
def test_divergence_names_effect_sample_and_time(start: int) -> None:
    model = Model((PublishedBoucWen(beta=3e3), Arx(a=[-0.5], b=[0.5]), Creep(gamma=0.01)), PERIOD)
    voltage = np.concatenate((np.zeros(start), 5.0 - 5.0 * np.cos(np.arange(400) / 2.0)))
    with pytest.raises(DivergenceError) as raised:
        model.run(voltage, model.rest(0.0, time=2.0))
    assert raised.value.effect == "published_bouc_wen"
    steps, h = np.diff(voltage / 10.0, prepend=0.0), [0.0]
    for dv in steps:
        h.append(np.clip(h[-1] - 0.7691 * dv - 3e3 * abs(dv) * h[-1] + 0.8725 * dv * abs(h[-1]), -1e12, 1e12))
    first = int((np.abs(h[1:]) > 1e9).argmax())
    assert raised.value.sample == first > start
    assert raised.value.time == pytest.approx(2.0 + first * PERIOD)
    assert f"sample {first} " in str(raised.value)
