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

"""A model says outside of which voltages and frequencies it was not identified."""

import re

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.identified_range import identified_range, outside
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.range_watch import RangeWatch
from piezo_hysteresis.identification.steps.remaining_lag import error_of_lag
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

TIME = 1e-3 * np.arange(4000)


def sine(amplitude, frequency):
    drive = 5.0 + amplitude * np.sin(2.0 * np.pi * frequency * TIME)
    return Record(drive, 1e-6 * drive, 1e-3, f"sine_{frequency:g}hz")


def test_only_a_drive_outside_the_range_is_reported():
    fitted = (sine(2.0, 1.0), sine(3.0, 10.0))
    origin = identified_range(fitted, (0, 1))
    assert (float(origin["voltage_min"]), float(origin["voltage_max"])) == (2.0, 8.0)
    model = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), 1e-3, provenance=origin)
    assert outside(model, Experiment((sine(2.5, 5.0),))) == ()
    kinds = [[n.kind for n in outside(model, Experiment((r,)))] for r in (sine(4.0, 5.0), sine(2.0, 40.0))]
    assert kinds == [["outside_amplitudes"], ["outside_frequencies", "outside_rates"]]
    (slow,) = outside(model, Experiment((sine(2.5, 0.25),)))
    assert slow.kind == "outside_frequencies"
    assert slow.message == "the drive is as slow as 0.25 Hz, the model was identified from 1 Hz"


def test_a_drive_is_reported_whose_slow_samples_do_not_show_the_dynamics():
    """A model with a pole of 5 ms was wrong by 17 % of the range at slow samples, and the stage got the blame."""
    period, pole = 2e-4, np.exp(-2e-4 / 5e-3)
    dynamics = Arx(a=(-pole,), b=(1.0 - 0.5 * pole, -0.5 * pole), delay=1.0)
    slow, fast = sine(3.0, 1.0), sine(3.0, 50.0)
    model = Model((BoucWen(), dynamics), period, provenance=identified_range((slow, fast), (0, 1)))
    (said,) = outside(model, Experiment((slow, fast)))
    fine = np.interp(period * np.arange(5 * TIME.size - 4), TIME, fast.voltage)
    exact = model.simulate(fine)[::5]
    coarse = model.simulate(fast.voltage, sample_period=1e-3)
    error = np.std((coarse - exact)[1000:]) / np.ptp(coarse[1000:])
    assert said.phase == fast.phase
    assert float(re.search("wrong by ([0-9.]+) %", said.message)[1]) == pytest.approx(100.0 * error, rel=0.2)


def test_a_step_does_not_hide_the_rates_of_the_sines_after_it():
    """It has most of the power of dv/dt; a model of 1 Hz was called known up to 870 Hz, and from 9 Hz on."""
    period = 5e-4
    drive = np.concatenate((np.zeros(100), *(growing_sine(f, period) for f in (1.0, 10.0, 60.0))))
    origin = identified_range((Record(drive, drive, period),), (0,))
    assert float(origin["frequency_min"]) == pytest.approx(1.0, rel=0.01)
    assert float(origin["frequency_max"]) == pytest.approx(60.0, rel=0.01)
    slow = growing_sine(1.0, period)
    model = Model((BoucWen(),), period, provenance=identified_range((Record(slow, slow, period),), (0,)))
    (fast,) = (n for n in outside(model, Experiment((sine(2.0, 60.0),))) if n.kind == "outside_frequencies")
    assert "the drive reaches 60 Hz, the model was identified up to 1 Hz" in fast.message


def held(level, before=0.0, **options):
    drive = np.full(2000, level)
    return Record(drive, 1e-6 * drive, 1e-3, "step", initial_voltage=before, **options)


def known_from(*records):
    return Model((BoucWen(),), 1e-3, provenance=identified_range(records, range(len(records))))


def test_a_short_sine_reaches_the_frequency_that_it_has():
    """The spread of its power was stated: 69 instead of 60 Hz, with an error of the lag that was larger by as much."""
    slow, fast = (Record(u, u, 5e-4) for u in (growing_sine(f, 5e-4) for f in (10.0, 60.0)))
    origin = identified_range((slow,), (0,)) | {"lag_uncertainty": "5e-05"}
    assert float(origin["frequency_max"]) == pytest.approx(10.0, rel=0.01)
    said = next(n.message for n in outside(Model((BoucWen(),), 5e-4, provenance=origin), Experiment((fast,))))
    reached, error = (float(re.search(f"{word} ([0-9.]+)", said)[1]) for word in ("reaches", "an error of"))
    assert reached == pytest.approx(60.0, rel=0.01)
    assert error == pytest.approx(100.0 * error_of_lag(5e-5, 60.0), rel=0.02)


def test_a_step_is_outside_the_range_of_sines_and_inside_that_of_a_step():
    """A model of sines of 10 Hz had 80 times the noise in a step, without a note."""
    from_sines, from_a_step = known_from(sine(4.0, 10.0)), known_from(held(4.0), sine(4.0, 10.0))
    (said,) = outside(from_sines, Experiment((held(5.0),)))
    assert said.kind == "outside_rates"
    assert "the drive steps by 5 V in one sample (5000 V/s), the model was identified up to" in said.message
    assert outside(from_a_step, Experiment((held(5.0), sine(4.0, 10.0)))) == ()
    later = Record(np.repeat([3.0, 6.0], 1000), np.repeat([3.0, 6.0], 1000), 1e-3, "steps")
    assert [n.kind for n in outside(from_sines, Experiment((later,)))] == ["outside_frequencies", "outside_rates"]
    assert "outside_rates" not in [n.kind for n in outside(from_a_step, Experiment((later,)))]


def test_a_step_between_two_records_and_in_a_stream_is_reported():
    rest = held(3.0, before=3.0)
    after = Record(np.full(2000, 6.0), np.full(2000, 6e-6), 1e-3, "step", continues=True)
    model = known_from(sine(4.0, 10.0))
    assert [n.phase for n in outside(model, Experiment((rest, after)))] == ["step"]
    assert outside(known_from(rest, after, sine(4.0, 10.0)), Experiment((rest, after))) == ()
    watch = RangeWatch(model, 1e-3)
    for level in (3.0, 6.0):
        watch.add(np.full(500, level))
    assert any("the drive changes by 3000 V/s" in n.message for n in watch.findings())


@pytest.mark.parametrize("options", [{"truncated": True}, {"start_time": 4.1}])
def test_what_the_drive_did_in_lost_samples_is_no_step(options):
    """It was said to be one between two samples, and the model stated it as the steepest that it knows."""
    rest = held(3.0, before=3.0)
    after = Record(np.full(2000, 6.0), np.full(2000, 6e-6), 1e-3, "later", continues=True, **options)
    assert outside(known_from(sine(4.0, 10.0)), Experiment((rest, after))) == ()
    assert float(identified_range((rest, after), (0, 1))["step_rate_max"]) == 0.0


def test_a_rest_in_which_the_drive_hardly_moves_shows_no_frequency():
    drive = 3.0 * (1.0 - np.cos(2.0 * np.pi * TIME))
    rest, sine_1hz = Record(drive, 1e-6 * drive, 1e-3, "rest").split(40)
    origin = identified_range((rest, sine_1hz), (0, 1))
    assert float(origin["frequency_max"]) < 2.0
    model = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), 1e-3, provenance=origin)
    assert outside(model, Experiment((rest,))) == ()


def test_a_stream_is_watched_block_by_block():
    model = Model((BoucWen(),), 1e-3, provenance=identified_range((sine(3.0, 2.0),), (0,)))
    for record, kinds in (
        (sine(3.0, 2.0), []),
        (sine(5.0, 2.0), ["outside_amplitudes", "outside_rates"]),
        (sine(1.0, 20.0), ["outside_frequencies", "outside_rates"]),
        (sine(3.0, 0.2), ["outside_frequencies"]),
    ):
        watch = RangeWatch(model, 1e-3)
        for block in np.split(record.voltage, 40):
            watch.add(block)
        assert [n.kind for n in watch.findings()] == kinds


def test_one_swing_of_a_slow_drive_does_not_show_a_frequency():
    model = Model((BoucWen(),), 1e-3, provenance=identified_range((sine(3.0, 2.0),), (0,)))
    watch = RangeWatch(model, 1e-3)
    watch.add(sine(3.0, 2.0).voltage[:100])
    assert watch.findings() == ()


def test_the_bound_of_an_uncertain_lag_covers_a_fast_drive():
    """One rate without a step cannot tell a lag from creep, so 60 Hz is predicted badly; the notice says how badly."""
    stage, period = Nanopositioner(mode=700.0, creep_fast=0.006, creep_slow=0.016), 5e-4

    def played(frequency):
        swing = 1.0 - np.cos(2.0 * np.pi * frequency * period * np.arange(round(2.0 / frequency / period)))
        return stage.play(np.concatenate([level * swing for level in (1.0, 2.0, 3.0, 4.0, 5.0)]), period)

    found = identify(Experiment((played(1.0),)), memory=True)
    (said,) = (n.message for n in found.notices if n.kind == "lag_only")
    fast = played(60.0)
    (warning,) = (n.message for n in outside(found.model, Experiment((fast,))) if n.kind == "outside_frequencies")
    allowed = 100.0 * error_of_lag(float(found.model.provenance["lag_uncertainty"]), 60.0)
    error = 100.0 * np.std(fast.displacement - found.model.simulate(fast)[0]) / np.ptp(fast.displacement)
    assert 0.65 < error < allowed < 35.0
    assert "its lag is known within" in warning
    known_to = float(re.search(r"above ([\d.]+) Hz, this uncertainty allows", said).group(1))
    assert 100.0 * error_of_lag(float(found.model.provenance["lag_uncertainty"]), known_to) == pytest.approx(
        1.0, rel=0.05
    )


def test_the_error_of_a_late_sine_is_that_of_the_difference():
    time = np.arange(60_000) / 60_000
    for late in (1e-5, 1e-3, 8e-3):
        off = np.sin(2.0 * np.pi * 60.0 * time) - np.sin(2.0 * np.pi * 60.0 * (time - late))
        assert error_of_lag(late, 60.0) == pytest.approx(np.std(off) / 2.0, rel=1e-6)
    assert error_of_lag(1.0, 60.0) == pytest.approx(0.5**0.5)


def test_a_model_without_its_range_gives_no_notice():
    model = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), 1e-3)
    assert outside(model, Experiment((sine(4.0, 40.0),))) == ()
