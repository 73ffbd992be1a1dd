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

"""What a plan says before anything moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.other_forms import KINDS, random_stage
from benchmarks.prediction import fitted_drives, measured
from piezo_hysteresis.compensation import Limits, plan, reachable
from piezo_hysteresis.compensation.approach import APPROACH
from piezo_hysteresis.compensation.expected_error import free_run_error, parameter_error
from piezo_hysteresis.effects import AmplifierSaturation, AmplifierSlewLimit, Arx, BoucWen, Creep, Effect, ThermalDrift
from piezo_hysteresis.effects.drive.amplifier_slew_limit_settling import AmplifierSlewLimitSettling
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.parameter_covariance import ParameterCovariance
from piezo_hysteresis.record import Experiment

from .published import PERIOD, stage, swing, triangle

UNIPOLAR = Limits(0.0, 10.0)


def test_a_path_within_reach_is_planned_to_the_band() -> None:
    y = triangle(50.0, 2e-6, 6e-6, 3)
    found = plan(stage(Creep(gamma=0.01)), y, UNIPOLAR)
    assert found.reachability.is_whole and found.reachability.nearest is None
    assert found.voltage.size == found.predicted.size == y.size + found.begin
    off = found.path_predicted - y
    assert found.expected.planned == pytest.approx(np.sqrt(np.mean(off**2)))
    assert found.expected.planned < 5e-4 * found.range
    assert found.expected.free_run == 5e-9
    assert found.expected.total == pytest.approx(np.hypot(found.expected.planned, 5e-9))
    assert np.abs(np.diff(found.predicted[: found.begin])).max() < 2e-8, "no jump on the way there"


def test_a_plan_states_by_how_much_an_earlier_drive_changes_the_path() -> None:
    """A stage that was driven since does not begin at rest; the first rise of the plan was wrong without a word."""
    model, y = stage(), swing(50.0, 2e-6, 6e-6, 3)
    model = replace(model, provenance={**model.provenance, "voltage_min": "0", "voltage_max": "10"})
    found = plan(model, y, UNIPOLAR)
    slow = np.concatenate((np.linspace(0.0, 10.0, 20_000), np.linspace(10.0, 0.0, 20_000), np.zeros(500)))
    _, driven = model.run(slow, model.rest(0.0))
    reached, _ = model.run(found.voltage, driven)
    off = (reached - found.predicted)[found.begin : found.begin + y.size]
    assert found.after_drive == pytest.approx(np.std(off), rel=1e-3)
    assert found.after_drive > found.expected.total
    straight = model.with_effect(BoucWen(A=0.0)).with_effect(ThermalDrift(D=1e-6, tau=1.0))
    assert plan(straight, y, UNIPOLAR).after_drive < 1e-15, "a drift is no matter of the drive"


def test_zero_after_a_loop_on_unipolar_drive_needs_a_negative_voltage() -> None:
    y = swing(50.0, 0.0, 6e-6, 2)
    model = stage()
    found = plan(model, y, UNIPOLAR).reachability
    assert not found.is_whole
    first = found.parts[0]
    assert first.limit == "voltage_min" and first.needed_min < 0.0 and first.after_loop and first.largest > 0.0
    assert 0.015 < first.begin < 0.02 < first.end < 0.025, "at the end of the first loop, not at its start"
    assert "below voltage_min" in str(first)
    nearest = found.nearest
    assert nearest is not None and nearest.offset is not None and nearest.amplitude is not None
    assert nearest.offset > 0.0 and 0.0 < nearest.amplitude < 1.0
    middle = 0.5 * (y.min() + y.max())
    for other in (y + nearest.offset, middle + nearest.amplitude * (y - middle)):
        assert plan(model, other, UNIPOLAR).reachability.is_whole
    less = plan(model, y + 0.5 * nearest.offset, UNIPOLAR)
    assert not less.reachability.is_whole, "the nearest is no farther than it must be"
    assert reachable(model, Limits(-2.0, 10.0), y).is_whole


@pytest.mark.parametrize("low", [22e-6, 40e-6, 1e-3, -5e-6])
def test_a_small_path_far_outside_the_range_is_shifted_into_it(low: float) -> None:
    y = swing(50.0, low, low + 1e-6, 2)
    nearest = plan(stage(), y, UNIPOLAR).reachability.nearest
    assert nearest is not None and nearest.offset is not None
    assert plan(stage(), y + nearest.offset, UNIPOLAR).reachability.is_whole
    assert not plan(stage(), y + nearest.offset - np.sign(nearest.offset) * 1e-7, UNIPOLAR).reachability.is_whole


@pytest.mark.parametrize(("low", "high"), [(0.8, 1.4), (0.5, 1.1)])
def test_what_a_plan_proposes_is_a_plan_without_complaint(low: float, high: float) -> None:
    """What is shifted and scaled is the path, and not the approach to it, which begins where the stage is."""
    model, limits = stage(), Limits(0.0, 4.0)
    top = float(model.run([4.0], model.rest(4.0))[0][0])
    y = swing(50.0, low * top, high * top, 1)
    refused = plan(model, y, limits, approach=0.01).reachability
    assert refused.nearest is not None and refused.nearest.offset is not None
    assert plan(model, y + refused.nearest.offset, limits, approach=0.01).reachability.is_whole
    if low + high > 2.0:
        assert refused.nearest.amplitude is None, "the middle of the path is out of reach itself"
    else:
        assert refused.nearest.amplitude is not None
        middle = 0.5 * (y.min() + y.max())
        smaller = middle + refused.nearest.amplitude * (y - middle)
        assert plan(model, smaller, limits, approach=0.01).reachability.is_whole


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_only_what_rest_reaches_is_said_to_be_kept_by_the_hysteresis(sign: float) -> None:
    loop = BoucWen()
    numbers = {name: sign * loop[name] for name in ("A", "p1", "p2", "gamma")} | {"beta": loop["beta"]}
    model = stage().with_effect(BoucWen(**numbers))
    after = reachable(model, UNIPOLAR, sign * swing(50.0, 0.0, 6e-6, 1))
    assert after.parts[-1].after_loop and "keeps the stage beyond it" in str(after.parts[-1])
    outside = reachable(model, UNIPOLAR, -sign * swing(50.0, 0.0, 1e-6, 1))
    assert {(part.limit, part.after_loop) for part in outside.parts} == {("voltage_min", False)}


def test_what_waiting_reaches_is_not_said_to_be_kept_by_the_hysteresis() -> None:
    """To fall fast, a stage with a lag of 1 ms needs a negative voltage. It has no hysteresis."""
    y = swing(200.0, 1e-7, 5e-6, 2)
    slow = stage().with_effect(Arx(a=[-0.98], b=[0.02], delay=0)).with_values({"bouc_wen.A": 0.0})
    found = reachable(slow, UNIPOLAR, y)
    assert {(part.limit, part.after_loop) for part in found.parts} == {("voltage_min", False)}


def test_too_high_and_too_fast_are_distinguished() -> None:
    model = stage()
    high = reachable(model, Limits(0.0, 4.0), swing(20.0, 1e-6, 12e-6, 1))
    assert {p.limit for p in high.parts} >= {"voltage_max"}
    fast = plan(model, triangle(200.0, 2e-6, 6e-6, 4), Limits(0.0, 10.0, 1e3)).reachability
    assert {p.limit for p in fast.parts} == {"max_slew_rate"}
    assert max(p.needed_slew for p in fast.parts) > 1e3


def test_every_limit_that_a_part_exceeds_is_named() -> None:
    """A fast rise beyond voltage_max was said to be too high only; with more volts it was too steep."""
    y = swing(100.0, 2e-6, 18e-6, 1)
    (part,) = plan(stage(), y, Limits(0.0, 8.0, 2e3)).reachability.parts
    assert part.limit == "voltage_max" and part.other_limits == ("max_slew_rate",)
    assert part.needed_max > 8.0 and part.needed_slew > 2e3
    assert "above voltage_max, and" in str(part) and "above max_slew_rate" in str(part)
    higher = plan(stage(), y, Limits(0.0, 20.0, 2e3)).reachability.parts
    assert {(part.limit, part.other_limits) for part in higher} == {("max_slew_rate", ())}
    slower = plan(stage(), y, Limits(0.0, 8.0)).reachability.parts
    assert {(part.limit, part.other_limits) for part in slower} == {("voltage_max", ())}


@pytest.mark.parametrize("begin", [0, 500])
def test_a_step_is_said_to_be_too_fast_by_the_slope_that_it_needs(begin: int) -> None:
    """The slope to the first sample of a part did not count: a step needed "0 V/s, above max_slew_rate"."""
    model = Model((BoucWen(), Arx(b=[0.5])), PERIOD, 10.0, 4e-5)
    top = float(model.run([5.0, 5.0], model.rest(0.0))[0][-1])
    y = np.where(np.arange(1000) < begin, 0.0, top)
    (part,) = reachable(model, Limits(0.0, 10.0, 1e4), y).parts
    assert part.limit == "max_slew_rate" and part.begin == pytest.approx(begin * PERIOD)
    assert part.needed_slew == pytest.approx(5.0 / PERIOD, rel=0.01)


@pytest.mark.parametrize(
    "limit",
    [AmplifierSaturation(upper=4.5), AmplifierSlewLimit(S=300.0), AmplifierSlewLimitSettling(S=300.0, tau=1e-4)],
)
def test_what_the_amplifier_of_the_model_cannot_give_is_not_reachable(limit: Effect) -> None:
    """The limits of the drive were compared only, and a fifth of the path was missing."""
    model = stage().with_effect(limit)
    y = swing(50.0, 3e-6, 9e-6, 2)
    found = plan(model, y, UNIPOLAR).reachability
    assert {part.limit for part in found.parts} == {"amplifier"}
    assert "more than the amplifier of the model gives" in str(found.parts[0])
    assert max(abs(part.largest) for part in found.parts) > 0.5e-6
    assert found.nearest is not None and found.nearest.amplitude is not None
    middle = 0.5 * (y.min() + y.max())
    assert plan(model, middle + found.nearest.amplitude * (y - middle), UNIPOLAR).reachability.is_whole
    assert plan(stage(), y, UNIPOLAR).reachability.is_whole


@pytest.mark.parametrize("limits", [Limits(), Limits(-50.0, 100.0), Limits(0.0, 40.0)])
def test_what_no_voltage_gives_is_not_reachable(limits: Limits) -> None:
    """The cubic bends the curve until it falls. The drive stayed at its highest point, with and without the limits."""
    model = stage()
    highest = 10.0 * np.sqrt(model["bouc_wen"]["p2"] / -3.0 / model["bouc_wen"]["p1"])
    top = float(model.run([highest], model.rest(highest))[0][0])
    assert plan(model, swing(50.0, 0.3 * top, 0.6 * top, 2), limits).reachability.is_whole
    found = plan(model, swing(50.0, 0.3 * top, 1.5 * top, 2), limits)
    assert {part.limit for part in found.reachability.parts} == {"model"}
    assert "a displacement that no voltage gives in the model" in str(found.reachability.parts[0])
    largest = max(abs(part.largest) for part in found.reachability.parts)
    assert largest == pytest.approx(np.abs(found.path_predicted - found.wanted).max(), rel=1e-6)
    nearest = found.reachability.nearest
    assert nearest is not None and nearest.amplitude is not None
    middle = 0.5 * (found.wanted.min() + found.wanted.max())
    assert plan(model, middle + nearest.amplitude * (found.wanted - middle), limits).reachability.is_whole


def test_what_is_missed_by_less_than_the_model_knows_is_reachable() -> None:
    """A triangle down to where the stage had been was refused for 2.7 mV, 6 nm, with a model that errs by 25 nm.

    Paths behind a backlash were refused for 11 nm at their turns, with a model that errs by 18 nm.
    """
    model = stage()
    drive = 2.0 * (1.0 - np.cos(2.0 * np.pi * np.arange(4000) / 2000.0))
    _, start = model.run(drive, model.rest(0.0))
    y, _ = model.run(drive, start)
    assert free_run_error(model) == 5e-9
    assert reachable(model, UNIPOLAR, y - 4e-9, start=start).is_whole
    exact = replace(model, provenance={})
    parts = reachable(exact, UNIPOLAR, y - 4e-9, start=start).parts
    assert {part.limit for part in parts} == {"voltage_min"}
    assert 1e-9 < max(part.largest for part in parts) < 5e-9
    poor = replace(model, provenance={"free_run_error": "1e-6"})
    assert not reachable(poor, UNIPOLAR, y - 1e-7, start=start).is_whole


@pytest.mark.parametrize("amplitude", [2e-9, 20e-9, 2e-6])
def test_a_small_path_is_not_cut_off_within_the_tolerance_of_a_large_way_to_it(amplitude: float) -> None:
    """Half of a scan of 40 nm at the highest voltage was cut off, and the plan called it reachable."""
    model = replace(stage(), provenance={"free_run_error": "3e-8"})
    way = np.append(5.0 - 5.0 * np.cos(np.pi * np.arange(2500) / 2500.0), np.full(3000, 10.0))
    top = float(model.run(way, model.rest(0.0))[0][-1])
    wave = amplitude * np.sin(2.0 * np.pi * 20.0 * PERIOD * np.arange(5000))
    (part, *_) = plan(model, top + wave, UNIPOLAR).reachability.parts
    assert part.limit == "voltage_max" and part.largest == pytest.approx(-amplitude, rel=0.05)
    for level in (0.5 * top, top - 1.01 * amplitude):
        assert plan(model, level + wave, UNIPOLAR).reachability.is_whole


@pytest.mark.parametrize("period", [2e-5, 1e-3, 1e-2])
def test_the_way_to_a_path_from_the_lowest_voltage_is_reachable_at_every_rate(period: float) -> None:
    """At 100 Hz the way had 5 samples; the band swung below 0 V, and every path was refused."""
    model = Model((BoucWen(), Creep(gamma=0.01), Arx(b=[0.3, 0.2], a=[-0.5], delay=1)), period, 10.0, 4e-5)
    for low, high in ((2e-6, 6e-6), (6e-6, 6.1e-6)):
        y = low + 0.5 * (high - low) * (1.0 - np.cos(0.02 * np.arange(2000)))
        for approach in (APPROACH, 2.0 * period):
            assert plan(model, y, UNIPOLAR, approach=approach).reachability.is_whole


@pytest.mark.parametrize("metres", [0.5, 1.0, -1.0, 1e3])
def test_a_path_in_micrometres_is_out_of_reach(metres: float) -> None:
    assert not reachable(stage(), UNIPOLAR, np.full(16, metres)).is_whole


def test_the_way_back_ends_at_the_first_voltage_inside_the_slew_limit() -> None:
    y = swing(50.0, 2e-6, 6e-6, 2)[:-300]
    for slew, shortest in ((5e4, 0.02), (200.0, 0.005)):
        limits = Limits(0.0, 10.0, slew)
        there = plan(stage(), y[:1], Limits(0.0, 10.0)).voltage if slew > 1e3 else None
        found = (
            plan(stage(), y, limits, way_back=shortest)
            if slew > 1e3
            else plan(stage(), np.full(50, 3e-6), limits, approach=0.5, way_back=shortest)
        )
        assert there is None or there[-1] > 0.0
        assert found.voltage[-1] == found.voltage[0] == 0.0
        assert found.voltage.size - found.begin - found.wanted.size >= round(shortest / PERIOD)
        assert np.abs(np.diff(found.voltage)).max() <= slew * PERIOD * (1.0 + 1e-9)
        assert found.predicted.size == found.voltage.size
    with pytest.raises(ModelError, match="way_back"):
        plan(stage(), y, UNIPOLAR, way_back=-1.0)


def test_the_expected_error_includes_the_covariance() -> None:
    u = 3.0 * (1.0 - np.cos(np.arange(20_000) / 100.0))
    spread = 0.01
    model = replace(stage(), covariance=ParameterCovariance.of(["bouc_wen.p2"], np.array([[spread**2]])))
    rms = parameter_error(model, u, slice(None))
    moved = model.with_values({"bouc_wen.p2": model.values()["bouc_wen.p2"] + spread})
    change = moved.run(u, moved.rest(0.0))[0] - model.run(u, model.rest(0.0))[0]
    assert rms == pytest.approx(np.sqrt(np.mean(change**2)), rel=1e-3)
    found = plan(model, triangle(50.0, 2e-6, 6e-6, 2), UNIPOLAR)
    assert found.expected.parameters is not None and found.expected.parameters > 0.0


def test_stages_that_the_covariance_allows_miss_the_path_by_what_is_expected() -> None:
    """The total was the free-run error, 5 nm, where the parameters were uncertain by 65 nm."""
    spread = np.array([0.03, 0.01])
    names = ["bouc_wen.p2", "bouc_wen.A"]
    model = replace(stage(), covariance=ParameterCovariance.of(names, np.diag(spread**2)))
    y = swing(50.0, 2e-6, 6e-6, 2)
    found = plan(model, y, UNIPOLAR)
    rng = np.random.default_rng(0)
    missed = []
    for change in spread * rng.normal(size=(20, 2)):
        real = model.with_values({n: model.values()[n] + c for n, c in zip(names, change, strict=True)})
        measured, _ = real.run(found.voltage, real.rest(0.0))
        missed.append(np.mean((measured[found.begin : found.begin + y.size] - y) ** 2))
    assert found.expected.total == pytest.approx(np.sqrt(np.mean(missed)), rel=0.3)
    assert found.expected.total > 10.0 * 5e-9


@pytest.mark.parametrize("kind", ["generalised plays", pytest.param("Bouc-Wen, n = 1.6", marks=pytest.mark.soak)])
def test_a_stage_of_another_form_misses_the_path_by_about_what_is_expected(kind: str) -> None:
    """The uncertainty of the displacement at rest, which the zero of the sensor contains, made it ten times as much."""
    stage, drives = random_stage(KINDS[kind], 0), fitted_drives()
    records = [measured(stage, phase, drives[phase]) for phase in ("triangle", "noise")]
    model = identify(Experiment(records), memory=True).model
    at = float(model.run(np.zeros(1), model.rest(0.0))[0][0])
    time = np.arange(2000) * model.sample_period
    y = at + 5e-6 - 3e-6 * np.cos(2.0 * np.pi * 3.0 * time) + 1e-6 * np.sin(2.0 * np.pi * 7.0 * time)
    found = plan(model, y, UNIPOLAR, approach=0.2)
    reached = measured(stage, "path", found.voltage / 10.0).displacement
    missed = (reached - reached[:50].mean())[found.begin : found.begin + y.size] - (y - at)
    assert found.expected.parameters is not None
    assert 0.5 < found.expected.total / np.sqrt(np.mean(missed**2)) < 3.0


def test_neither_the_way_to_the_path_nor_the_way_back_changes_the_expected_error() -> None:
    """A rest of 0.5 s at 0 V, where an error of the slope does not show, more than halved the uncertainty."""
    model = replace(stage(), covariance=ParameterCovariance.of(["bouc_wen.p2"], np.array([[1e-4]])))
    y = swing(50.0, 2e-6, 6e-6, 2)
    found, longer = (plan(model, y, UNIPOLAR, way_back=seconds).expected for seconds in (0.0, 0.5))
    assert found.parameters is not None and found.parameters > 1e-8
    assert longer.parameters == pytest.approx(found.parameters) and longer.total == pytest.approx(found.total)


def test_a_plan_for_a_model_without_a_known_error_states_this() -> None:
    assert free_run_error(replace(stage(), provenance={})) is None
    assert free_run_error(replace(stage(), provenance={"free_run_error": "good"})) is None


def test_a_path_that_is_none_is_refused() -> None:
    for path in ([], [np.nan], [[0.0]]):
        with pytest.raises(ModelError):
            plan(stage(), path, UNIPOLAR)
    with pytest.raises(ModelError, match="approach"):
        plan(stage(), [0.0], UNIPOLAR, approach=-1.0)


def test_the_way_begins_where_the_stage_is() -> None:
    model = stage()
    _, state = model.run(3.0 * (1.0 - np.cos(np.arange(1500) / 90.0)), model.rest(0.0))
    _, state = model.run(np.full(2000, state.inputs[0]), state)
    y = np.full(500, 4e-6)
    found = plan(model, y, UNIPOLAR, start=state)
    assert abs(found.voltage[0] - state.inputs[0]) < 0.02
    assert np.abs(found.path_predicted - y).max() < 1e-10
    assert found.sample_period == PERIOD


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_band_is_reachable_and_not_much_lower_than_it_must_be(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, t = stage(), PERIOD * np.arange(6_000)
    frequency = 50.0 * 2.0 ** np.arange(0.0, 5.1, 0.25)
    rate, phase = 2.0 * np.pi * frequency[:, None], 2.0 * np.pi * rng.random(frequency.size)
    parts = 1e-3 / rate * np.sin(rate * t + phase[:, None])  # equally steep
    window, approach = (
        np.sin(np.pi * np.arange(t.size) / t.size) ** 2,
        0.5 - 0.5 * np.cos(np.pi * np.arange(3000) / 3000),
    )

    def below(highest: float) -> np.ndarray:
        """The path from rest, without its components above a frequency [Hz]."""
        return 1e-5 * np.append(approach, 1.0 + 1e5 * window * parts[frequency <= highest].sum(axis=0))

    limits = Limits(-20.0, 40.0, float(rng.uniform(1500.0, 3500.0)))
    found = plan(model, below(np.inf), limits).reachability
    assert {p.limit for p in found.parts} == {"max_slew_rate"}
    band = found.nearest.band if found.nearest else None
    assert band is not None and band < 1000.0
    assert f"components above {band:.3g} Hz are removed" in found.nearest.conditions()
    assert reachable(model, limits, below(band)).is_whole
    assert not reachable(model, limits, below(2.5 * band)).is_whole


@pytest.mark.parametrize("period", [PERIOD, 1e-3, 1e-2])
def test_the_nearest_band_is_found_at_every_rate(period: float) -> None:
    """The band of the search was 0.02 s long at every rate: 20 samples at 1 kHz, and none was found."""
    model, k = Model((BoucWen(), Arx(b=[0.5])), period, 10.0, 4e-5), np.arange(2000)
    slow = 4e-6 - 3e-6 * np.cos(2.0 * np.pi * k / 2000.0)
    limits = Limits(0.0, 10.0, 0.02 / period)
    fast = slow + 0.5e-6 * np.sin(2.0 * np.pi * k / 40.0)
    nearest = plan(model, fast, limits, approach=3000.0 * period).reachability.nearest
    assert nearest is not None and nearest.band is not None
    assert nearest.band * period == pytest.approx(0.016, rel=0.1)
