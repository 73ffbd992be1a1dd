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

"""Online prediction is the batch simulation, whatever the stream does to the blocks and whenever the model changes."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from piezo_hysteresis.effects import Arx, BoucWen, Creep, MainsHum, Offset
from piezo_hysteresis.errors import DivergenceError, ModelError, ParameterError, RecordError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.prediction import Prediction
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.record import Record

Array = NDArray[np.float64]

PERIOD = 2e-5
ARX = Arx(a=[-0.8], b=[0.05], delay=3.0)
MODEL = Model((BoucWen(), ARX), PERIOD, displacement_scale=1e-4)
OTHER = Model((BoucWen(A=-0.5, beta=3.0, gamma=-1.0, p1=-0.1, p2=1.9), ARX), PERIOD, displacement_scale=1e-4)


def sine(count: int, period: float = PERIOD, frequency: float = 50.0, rest: int = 0) -> Array:
    wave = 3.5 - 3.5 * np.cos(2 * np.pi * frequency * period * np.arange(count))
    return np.concatenate((np.zeros(rest), wave))


def truth(model: Model, voltage: Array) -> Array:
    return model.run(voltage, model.rest(voltage[0]))[0]


def feed(
    predictor: Predictor, voltage: Array, displacement: Array, size: int = 500, first: int = 0, stamp: int = 0
) -> list[Prediction]:
    """Consecutive blocks; `first` is the index of the first sample."""
    return [
        predictor.predict(
            (first + i) % 2**32,
            stamp + round(i * predictor.sample_period * 1e9),
            voltage[i : i + size],
            displacement[i : i + size],
        )
        for i in range(0, voltage.size, size)
    ]


def residual(answers: list[Prediction]) -> Array:
    return np.concatenate([a.residual for a in answers])


@settings(max_examples=12)
@given(st.integers(1, 700), st.integers(0, 900), st.integers(0, 2**32 - 1))
def test_a_clean_stream_is_the_batch_simulation_bit_for_bit(size: int, rest: int, first: int) -> None:
    voltage = sine(2000, rest=rest)
    measured = truth(MODEL, voltage)
    answers = feed(Predictor(PERIOD, MODEL), voltage, measured, size, first)
    np.testing.assert_array_equal(np.concatenate([a.prediction for a in answers]), measured)
    if rest >= size:
        assert not any(a.warming_up for a in answers)


@pytest.mark.parametrize("size", [1, 10, 300])
def test_noise_on_the_drive_is_predicted_as_in_batch_bit_for_bit(size: int) -> None:
    voltage = 2e-3 * np.random.default_rng(4).standard_normal(600)
    measured = truth(MODEL, voltage)
    answers = feed(Predictor(PERIOD, MODEL), voltage, measured, size)
    np.testing.assert_array_equal(np.concatenate([a.prediction for a in answers]), measured)


def test_a_small_voltage_scale_makes_a_small_drive_a_motion() -> None:
    small, other = (replace(model, voltage_scale=4e-3) for model in (MODEL, OTHER))
    voltage = 5e-4 * sine(6_000, rest=700)
    expected = truth(other, voltage)
    predictor = Predictor(PERIOD, small)
    feed(predictor, voltage[:3_000], expected[:3_000])
    predictor.swap(other, offset=0.0)
    error = residual(feed(predictor, voltage[3_000:], expected[3_000:], first=3_000))
    np.testing.assert_allclose(error[-2_000:], 0.0, atol=1e-9 * np.ptp(expected))


@pytest.mark.parametrize("number", [np.uint32, np.int64])
def test_index_and_stamp_may_be_of_numpy(number: type) -> None:
    predictor = Predictor(PERIOD, MODEL)
    rest = np.zeros(10)
    for first in (0, 10, 25):
        predictor.predict(number(first), number(first * 20_000), rest, rest)
    assert predictor.sequence.lost == 5


def test_a_model_swapped_in_mid_sine_is_right_at_once() -> None:
    """At the top of the sine a model that starts from rest there is wrong by percents, and stays so while held."""
    count = 101_000  # half a period before the top, where the sine stops; longer than one piece of history
    voltage = np.concatenate((sine(100_500, rest=1000), np.full(5000, 7.0)))
    measured = truth(OTHER, voltage)
    predictor = Predictor(PERIOD, MODEL)
    before = feed(predictor, voltage[:count], measured[:count])
    predictor.swap(OTHER)
    assert predictor.is_swapping
    assert predictor.model is MODEL
    after = feed(predictor, voltage[count:], measured[count:], first=count, stamp=round(count * PERIOD * 1e9))
    swapped = [a for a in after if a.model is OTHER]
    assert 0 < len(after) - len(swapped) < 4
    np.testing.assert_allclose(residual(swapped), 0.0, atol=1e-18)

    stroke = np.ptp(measured)
    top = voltage[101_500:]
    cold, _ = OTHER.run(top, OTHER.rest(top[0]))
    assert np.abs(cold - measured[101_500:])[100:].min() > 0.05 * stroke
    assert np.abs(residual(before)[20_000:]).max() > 0.01 * stroke


def test_hum_keeps_its_phase_over_a_swap() -> None:
    """Its time counts from the first sample, also where the history of the drive begins later."""
    model = MODEL.with_effect(MainsHum(f=51.3, cosine=[1e-7], sine=[2e-7]))
    drive = sine(6_000, rest=2_345)
    expected = truth(model, drive)
    predictor = Predictor(PERIOD)
    feed(predictor, drive[:5_000], expected[:5_000])
    predictor.swap(model, offset=0.0)
    predictions = np.concatenate([a.prediction for a in feed(predictor, drive[5_000:], expected[5_000:], first=5_000)])
    np.testing.assert_allclose(predictions[-500:], expected[-500:], rtol=0.0, atol=1e-12)


def test_models_that_come_faster_than_they_warm_up_take_over_in_turn() -> None:
    voltage = sine(300_000, rest=1000)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage, measured, 5000)
    end, tail = voltage.size, voltage[1000:31_000]
    models = [MODEL.with_values({"bouc_wen.p2": 1.0 + k / 1000}) for k in range(tail.size // 500)]
    taken = []
    for k, model in enumerate(models):
        predictor.swap(model)
        cut = slice(500 * k, 500 * (k + 1))
        index = (end + 500 * k) % 2**32
        taken.append(predictor.predict(index, round(index * PERIOD * 1e9), tail[cut], tail[cut] * 1e-6).model)
    assert len({id(model) for model in taken}) > 3
    while predictor.is_swapping:
        end += 500
        predictor.predict(end + tail.size, round((end + tail.size) * PERIOD * 1e9), tail[:500], tail[:500])
    assert predictor.model is models[-1]


def test_a_model_that_waited_does_not_take_over_from_a_newer_one() -> None:
    voltage = sine(101_000, rest=1000)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage, voltage * 1e-6, 5000)
    first, second, third = (MODEL.with_values({"bouc_wen.p2": value}) for value in (1.1, 1.2, 1.3))
    predictor.swap(first)
    predictor.swap(second)
    position = voltage.size
    for newer in (first, None):
        while predictor.is_swapping and predictor.model is not newer:
            predictor.predict(position, round(position * PERIOD * 1e9), [7.0], [7e-6])
            position += 1
        if newer is first:
            predictor.swap(third)
    assert predictor.model is third


def test_a_swap_near_the_beginning_is_immediate() -> None:
    voltage = sine(3000, rest=1000)
    measured = truth(OTHER, voltage) - 7e-6
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:2000], measured[:2000])
    predictor.swap(OTHER)
    assert predictor.model is OTHER
    after = feed(predictor, voltage[2000:], measured[2000:], first=2000, stamp=40_000_000)
    np.testing.assert_allclose(residual(after), 0.0, atol=1e-18)


def test_the_first_model_may_come_late() -> None:
    voltage = sine(5000, rest=1000)
    measured = truth(MODEL, voltage) + 3e-6
    predictor = Predictor(PERIOD)
    assert all(a.model is None and a.residual.size == 0 for a in feed(predictor, voltage[:3000], measured[:3000]))
    predictor.swap(MODEL)
    late = feed(predictor, voltage[3000:], measured[3000:], first=3000, stamp=60_000_000)
    np.testing.assert_allclose(residual(late), 0.0, atol=1e-18)
    assert predictor.offset == pytest.approx(3e-6, rel=1e-9)


def test_history_older_than_a_minute_is_averaged_and_still_good() -> None:
    period = 1e-3
    slow = [Model((m["bouc_wen"], Arx(a=[-0.5], b=[0.5])), period) for m in (MODEL, OTHER)]
    voltage = np.concatenate((sine(150_000, period, 0.3, rest=100), np.full(30_000, 4.0)))
    measured = truth(slow[1], voltage)
    predictor = Predictor(period, slow[0])
    feed(predictor, voltage, measured, 2000)
    predictor.swap(slow[1])
    tail = np.full(200_000, 4.0) + 0.01 * np.sin(np.arange(200_000) / 50)
    final = truth(slow[1], np.concatenate((voltage, tail)))[voltage.size :]
    after = feed(predictor, tail, final, 2000, voltage.size, round(voltage.size * period * 1e9))
    assert after[-1].model is slow[1]
    errors = residual([a for a in after if a.model is slow[1]])
    assert np.abs(errors).max() < 1e-3 * np.ptp(measured)


def test_lost_blocks_are_bridged_by_holding_the_voltage() -> None:
    voltage, first = sine(6000), 2**32 - 2000
    held = voltage.copy()
    held[2500:4000] = voltage[2499]
    measured = truth(MODEL, held)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:2500], measured[:2500], first=first)
    after = feed(predictor, voltage[4000:], measured[4000:], first=first + 4000, stamp=80_000_000)
    np.testing.assert_allclose(residual(after), 0.0, atol=1e-18)
    counts = predictor.sequence
    assert (counts.received, counts.lost, counts.repeated, counts.restarts) == (4500, 1500, 0, 0)


@pytest.mark.parametrize("seconds", [59.0, 600.0, 3600.0, 86400.0])
def test_a_long_hold_is_predicted_as_the_simulation_of_it(seconds: float) -> None:
    """Of a hold of an hour, creep had gone on for a minute only, and nothing said that it was wrong."""
    period, count = 1e-3, 2000
    model = Model((BoucWen(), Creep(gamma=0.02)), period, displacement_scale=1e-5)
    drive = np.concatenate((np.zeros(500), np.linspace(0.0, 5.0, 500), np.full(count - 1000, 5.0)))
    predictor, later = Predictor(period, model), count + round(seconds / period)
    before = [predictor.predict(k, k * 10**6, drive[k : k + 100], truth(model, drive)[k : k + 100])
              for k in range(0, count, 100)]  # fmt: skip
    back = np.concatenate((np.full(200, 5.0), np.linspace(5.0, 2.0, 300)))
    first = Record(drive, drive, period, "before")
    second = Record(back, back, period, "after", start_time=later * period, continues=True)
    expected = model.simulate([first, second])[1] + before[-1].prediction[-1] - truth(model, drive)[-1]
    answer = predictor.predict(later, later * 10**6, back, expected, follows_gap=True)
    assert not answer.warming_up
    assert np.abs(answer.residual).max() < 1e-4 * np.ptp(expected)
    predictor.swap(model)  # the history holds the time, too
    for k in range(500, 40_000, 500):
        more = np.full(500, back[-1])
        again = predictor.predict(later + k, (later + k) * 10**6, more, more)
        if not predictor.is_swapping:
            break
    state = predictor.state
    assert state is not None and state.time == pytest.approx((later + k + 500) * period)
    assert again.prediction.size == 500


@pytest.mark.parametrize(("frequency", "seconds"), [(40.0, 100.0), (1.0, 8000.0)])
def test_a_model_that_is_changed_after_a_long_hold_knows_the_turns_before_it(frequency: float, seconds: float) -> None:
    """Averages of the drive lose the turns of a fast one, and a night of hold must not displace what was before it."""
    period, count = 1e-3, 4000
    time = period * np.arange(count)
    drive = 2.0 - 2.0 * np.cos(2.0 * np.pi * frequency * np.maximum(time - 0.02, 0.0))
    drive[2700:] = np.interp(np.arange(1300), [0, 300], [drive[2700], 2.0])
    tail = 2.0 + 0.3 * np.sin(2.0 * np.pi * 2.0 * period * np.arange(6000))
    model = Model((BoucWen(), Arx(a=[-0.7], b=[0.15], delay=1.0)), period)
    both = truth(model, np.concatenate((drive, np.full(1000, drive[-1]), tail)))
    before, after = both[:count], both[count + 1000 :]
    predictor = Predictor(period, model)
    feed(predictor, drive, before)
    begin = count + round(seconds / period)
    predictor.predict(begin, begin * 10**6, tail[:100], after[:100], follows_gap=True)
    predictor.swap(replace(model), predictor.offset)
    answers = [
        predictor.predict(begin + k, (begin + k) * 10**6, tail[k : k + 100], after[k : k + 100])
        for k in range(100, 6000, 100)
    ]
    assert not predictor.is_swapping and not predictor.warming_up
    assert np.abs(residual(answers[-20:])).max() < 1e-6 * np.ptp(both)


def test_invalid_options_are_refused() -> None:
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="rms_time: got"):
            Predictor(PERIOD, MODEL, rms_time=wrong)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, np.zeros(500), np.zeros(500))
    with pytest.raises(ParameterError, match="offset: got nan"):
        predictor.swap(OTHER, offset=np.nan)


def test_samples_that_were_never_measured_are_not_lost() -> None:
    voltage = sine(2000)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:500], voltage[:500])
    predictor.predict(1500, 30_000_000, voltage[1500:], voltage[1500:], follows_gap=True)
    assert predictor.sequence.lost == 0


@settings(max_examples=50)
@given(
    st.lists(st.sampled_from(["pass", "lose", "double", "late"]), min_size=3, max_size=25), st.integers(0, 2**32 - 1)
)
def test_sent_is_received_plus_lost(fates: list[str], first: int) -> None:
    """Whatever happens to the blocks, every sample counts once, and the prediction is that of the held voltage."""
    size = 100
    voltage = sine(size * len(fates))
    predictor = Predictor(PERIOD, MODEL)
    given_voltage, waiting, expected = voltage.copy(), None, 0

    def send(block: int) -> Prediction:
        cut = slice(block * size, (block + 1) * size)
        return predictor.predict((first + block * size) % 2**32, block * 2_000_000, voltage[cut], voltage[cut])

    for block, fate in enumerate(fates):
        if fate == "lose" and 0 < block < len(fates) - 1:
            held = given_voltage[block * size - 1]
            given_voltage[block * size : (block + 1) * size] = held
            waiting = block
            continue
        answer = send(block)
        assert answer.prediction.size == size
        expected += size
        if fate == "double":
            assert send(block).prediction.size == 0
        if fate == "late" and waiting is not None:
            again = send(waiting)
            assert again.first == size
            waiting = None
    counts = predictor.sequence
    assert counts.received == expected
    assert counts.received + counts.lost == voltage.size
    whole = truth(MODEL, given_voltage)
    np.testing.assert_allclose(answer.prediction, whole[-size:] + predictor.offset, atol=1e-18)


def test_a_block_that_overlaps_counts_from_its_first_new_sample() -> None:
    voltage = sine(1000)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:600], measured[:600])
    answer = predictor.predict(400, 8_000_000, voltage[400:], measured[400:])
    assert answer.first == 200
    np.testing.assert_array_equal(answer.prediction, measured[600:])


@pytest.mark.parametrize("stamp", [90_000_000_000, -90_000_000_000])
def test_a_driver_started_again_begins_a_new_stream(stamp: int) -> None:
    """Also a bag that is played in a loop: index and stamps go back together."""
    voltage = sine(60_000)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage, measured, first=70_000)
    again = feed(predictor, voltage[:5000], measured[:5000] + 1e-6, first=10, stamp=stamp)
    np.testing.assert_allclose(residual(again), 0.0, atol=1e-18)
    assert predictor.sequence.restarts == 1


def test_a_stream_joined_in_motion_is_flagged_until_the_loops_have_forgotten() -> None:
    voltage = sine(20_000)
    measured = truth(MODEL, voltage)
    joined = 700
    predictor = Predictor(PERIOD, MODEL)
    answers = feed(predictor, voltage[joined:], measured[joined:], first=joined)
    flags = [a.warming_up for a in answers]
    assert flags[0]
    assert flags == sorted(flags, reverse=True)
    known = [a for a in answers if not a.warming_up]
    assert len(known) > len(answers) / 2
    assert np.abs(residual(known)).max() < 1e-3 * np.ptp(measured)
    assert np.abs(residual(answers[:3])).max() > 1e-2 * np.ptp(measured)


def test_after_a_gap_predictions_are_flagged_until_the_memory_is_lost() -> None:
    """What the drive did in the gap is unknown: from the bottom to the top and back, or nothing."""
    voltage = sine(30_000, rest=1000)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    assert not any(a.warming_up for a in feed(predictor, voltage[:11_400], measured[:11_400]))
    after = feed(predictor, voltage[12_200:], measured[12_200:], first=12_200, stamp=244_000_000)
    flags = [a.warming_up for a in after]
    assert flags[0]
    assert flags == sorted(flags, reverse=True)
    known = [a for a in after if not a.warming_up]
    assert len(known) > len(after) / 2
    assert np.abs(residual(known)).max() < 1e-3 * np.ptp(measured)
    assert np.abs(residual(after[:3])).max() > 1e-2 * np.ptp(measured)


def test_a_gap_at_rest_may_hide_a_loop() -> None:
    predictor = Predictor(PERIOD, MODEL)
    rest = np.zeros(500)
    assert not any(a.warming_up for a in feed(predictor, rest, rest))
    assert predictor.predict(2000, 40_000_000, rest, rest).warming_up
    assert predictor.predict(2500, 50_000_000, rest, rest).warming_up


def test_a_new_stage_is_at_rest_and_a_stage_driven_before_is_unknown() -> None:
    rest = np.zeros(500)
    for settled in (True, False):
        predictor = Predictor(PERIOD, MODEL)
        assert predictor.predict(0, 0, rest, rest, settled=settled).warming_up is not settled
        assert predictor.predict(2000, 40_000_000, rest, rest, follows_gap=True).warming_up is not settled


def test_noise_of_a_measured_drive_does_not_erase_the_memory() -> None:
    voltage = sine(1000, rest=0)[500:]
    held = voltage[-1] + 1e-3 * np.random.default_rng(1).standard_normal(200_000)
    predictor = Predictor(PERIOD, MODEL)
    stream = np.concatenate((voltage, held))
    assert all(answer.warming_up for answer in feed(predictor, stream, truth(MODEL, stream)))


def test_the_offset_comes_from_the_first_rest_only() -> None:
    """Ten noisy milliseconds per block average out; what moves later cannot shift the zero."""
    random = np.random.default_rng(1)
    voltage = sine(20_000, rest=4000)
    measured = truth(MODEL, voltage) + 5e-6 + 1e-8 * random.standard_normal(voltage.size)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:4000], measured[:4000])
    offset = predictor.offset
    assert offset == pytest.approx(5e-6, abs=5 * 1e-8 / np.sqrt(4000))
    drifted = measured + 1e-6
    feed(predictor, voltage[4000:], drifted[4000:], first=4000, stamp=80_000_000)
    assert predictor.offset == offset
    assert predictor.residual_rms == pytest.approx(1e-6 * np.sqrt(20_000 / 24_000), rel=0.01)
    predictor.zero()
    assert predictor.residual_rms is None
    end = voltage.size
    feed(predictor, np.full(10_000, voltage[-1]), np.full(10_000, 2.0), first=end, stamp=round(end * PERIOD * 1e9))
    assert predictor.residual_rms == pytest.approx(0.0, abs=1e-7)


def test_waiting_for_a_model_takes_no_memory() -> None:
    """Every block left an entry of no samples in the rms of the residual, 0.7 GB a day."""
    predictor, rest, sizes = Predictor(PERIOD), np.zeros(500), []
    tracemalloc.start()
    for first in (0, 1000):
        for k in range(first, first + 1000):
            predictor.predict(500 * k, 10_000_000 * k, rest, rest)
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert sizes[1] - sizes[0] < 10_000


def test_residual_rms_is_that_of_the_last_second() -> None:
    voltage = np.zeros(200_000)
    measured = np.zeros(200_000)
    measured[50_000:120_000:2] = 2e-8
    measured[120_000::2], measured[120_001::2] = 1e-8, -1e-8
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage, measured)
    assert predictor.residual_rms == pytest.approx(1e-8, rel=1e-6)


def test_a_slower_stream_takes_the_slow_chain_and_a_faster_one_is_refused() -> None:
    voltage = sine(2000, 5e-3, 1.0, rest=10)
    expected, _ = MODEL.at(5e-3).run(voltage, MODEL.at(5e-3).rest(0.0))
    answers = feed(Predictor(5e-3, MODEL), voltage, expected, 2)
    np.testing.assert_allclose(residual(answers), 0.0, atol=1e-18)
    fast = Predictor(1e-5)
    with pytest.raises(ModelError, match="sample period"):
        fast.swap(MODEL)


def test_bad_blocks_are_reported_and_count_as_lost() -> None:
    voltage = sine(1500)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:500], voltage[:500])
    broken = voltage[500:1000].copy()
    broken[7] = np.nan
    with pytest.raises(ModelError, match="sample 7 is not finite"):
        predictor.predict(500, 10_000_000, broken, voltage[500:1000])
    with pytest.raises(RecordError, match="got 3 samples, expected 500"):
        predictor.predict(500, 10_000_000, voltage[500:1000], voltage[:3])
    predictor.predict(1000, 20_000_000, voltage[1000:], voltage[1000:])
    assert predictor.sequence.lost == 500


def test_a_model_that_runs_away_is_dropped_and_the_next_one_works() -> None:
    wild = Model((BoucWen(p2=1000.0), Arx(b=[1e6, 1e6, 1e6, 1e6])), PERIOD)
    voltage = sine(1500, rest=500)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, wild)
    feed(predictor, voltage[:500], measured[:500])
    with pytest.raises(DivergenceError):
        feed(predictor, voltage[500:1000], measured[500:1000], first=500, stamp=10_000_000)
    assert predictor.model is None
    predictor.swap(MODEL)
    with pytest.raises(DivergenceError):
        predictor.swap(wild)
    assert predictor.model is MODEL
    after = feed(predictor, voltage[1000:], measured[1000:], first=1000, stamp=20_000_000)
    np.testing.assert_allclose(residual(after), 0.0, atol=1e-18)


def test_a_constant_sensor_offset_in_the_model_changes_nothing() -> None:
    voltage = sine(1000, rest=500)
    measured = truth(MODEL, voltage)
    answers = feed(Predictor(PERIOD, MODEL.with_effect(Offset(y0=1e-3))), voltage, measured)
    np.testing.assert_allclose(residual(answers), 0.0, atol=1e-15)


def test_a_new_model_that_diverges_late_in_the_history_leaves_the_present_one_in_use() -> None:
    """Its run over a long history ends in a later block, whose prediction by the present model is as good as any."""
    wild = Model((BoucWen(p2=1000.0), Arx(b=[1e6, 1e6, 1e6, 1e6])), PERIOD)
    voltage = np.concatenate((0.01 * sine(100_000, rest=1000), sine(20_000)))
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:115_000], measured[:115_000], 5000)
    predictor.swap(wild)
    assert predictor.newest_model is wild
    after = feed(predictor, voltage[115_000:], measured[115_000:], first=115_000, stamp=2_300_000_000)
    np.testing.assert_allclose(residual(after), 0.0, atol=1e-18)
    assert all(answer.model is MODEL for answer in after)
    (refused,) = [answer.refused for answer in after if answer.refused is not None]
    assert isinstance(refused, DivergenceError)
    assert predictor.newest_model is predictor.model is MODEL


def test_what_counts_as_motion_is_decided_by_the_model_in_use() -> None:
    """While a model of a large stage is run over the history, a travel of volts still makes the state known."""
    large = replace(MODEL, voltage_scale=1e5)
    voltage = sine(403_000)
    measured = truth(MODEL, voltage)
    predictor = Predictor(PERIOD, MODEL)
    feed(predictor, voltage[:399_500], measured[:399_500], 4700)
    predictor.swap(large)
    feed(predictor, voltage[400_000:], measured[400_000:], first=400_000, stamp=8_000_000_000)  # 500 samples were lost
    assert predictor.newest_model is large and predictor.model is MODEL
    assert not predictor.warming_up
