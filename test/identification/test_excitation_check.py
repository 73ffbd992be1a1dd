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

"""An effect is reported as not excited exactly if the experiment cannot show it."""

import numpy as np
import pytest

from piezo_hysteresis.identification.records.excitation_check import missing_excitation, one_way
from piezo_hysteresis.record import Record

TIME = 1e-3 * np.arange(2000)


def record(drive, period=1e-3, phase="triangle", **options):
    return Record(drive, 1e-6 * drive, period, phase=phase, **options)


def loops(*peaks):
    return np.concatenate([peak * (1 - np.abs(2 * (TIME % 1) - 1)) for peak in peaks])


def missing(*records, found=()):
    return " ".join(n.message for n in missing_excitation(records, range(len(records)), found))


def test_one_triangle_of_one_amplitude_shows_few_effects():
    said = missing(record(loops(4.0)))
    for name in ("creep", "thermal_drift", "gain_drift", "hysteresis_memory", "hysteresis_exponent", "extra_resonance"):
        assert name in said


def test_an_effect_that_was_found_is_not_reported_as_hidden():
    assert "creep" not in missing(record(loops(4.0)), found={"creep"})
    assert "extra_resonance" not in missing(record(loops(4.0)), found={"extra_resonance"})


def test_an_effect_that_was_found_shows_the_effects_of_its_kind():
    """A low-pass was named beside the note that these data can hardly show lags."""
    assert "dynamics" not in missing(record(loops(4.0)), found={"extra_resonance"})
    for lag in ("amplifier_bandwidth", "sensor_bandwidth", "extra_delay"):
        said = missing(record(loops(4.0)), found={lag})
        assert "can hardly show extra_resonance, because no drive excites the dynamics" in said
        assert "lags" not in said


def test_smaller_loops_show_memory():
    assert "hysteresis_memory" not in missing(record(loops(4.0, 2.0)))
    assert "hysteresis_memory" not in missing(record(loops(4.0)), record(loops(2.0)))


def test_a_hold_after_a_change_shows_creep_and_a_hold_from_the_start_does_not():
    assert "creep" in missing(record(np.full(2000, 3.0)), record(loops(4.0)))
    assert "creep" not in missing(record(np.repeat([0.0, 3.0], 1500)))
    assert "creep" not in missing(record(np.full(2000, 3.0), initial_voltage=0.0))


def test_noise_shows_dynamics_and_a_repeated_phase_shows_drift():
    noise = record(np.random.default_rng(1).normal(size=4000), 2e-5, "noise")
    assert "extra_resonance" not in missing(noise)
    assert "drift" not in missing(noise, noise)


def test_loops_of_two_sizes_show_memory_at_any_sample_period_and_noise_does_not():
    noise = record(np.random.default_rng(1).normal(size=4000), 2e-5, "noise")
    assert "hysteresis_memory" in missing(record(loops(4.0, 4.0)), noise)
    assert "hysteresis_memory" in missing(record(np.sin(3.0 * np.pi * TIME)), noise)
    assert "hysteresis_memory" not in missing(record(loops(4.0, 2.0), 1e-4))


def test_repeated_slow_loops_show_drift_under_any_name():
    assert "drift" not in missing(record(loops(4.0), phase="run_a"), record(loops(2.0), phase="again"))
    assert "drift" in missing(record(loops(4.0), phase="run_a"))


def test_a_rest_is_no_second_slow_loop():
    for rest in (
        record(np.full(2000, 3.0), phase="rest"),
        record(np.full(2000, 3.0), initial_voltage=0.0, phase="step"),
    ):
        assert "no kind of phase was recorded twice" in missing(record(loops(4.0)), rest)


def fast_sine(*amplitudes):
    time = 1e-4 * np.arange(2000)
    return np.concatenate([5.0 + amplitude * np.sin(2.0 * np.pi * 100.0 * time) for amplitude in amplitudes])


def test_a_fast_sine_of_growing_amplitude_has_loops_of_several_amplitudes():
    assert "several amplitudes" in missing(record(fast_sine(4.0), 1e-4))
    assert "several amplitudes" not in missing(record(fast_sine(1.0, 2.0, 4.0), 1e-4))


def test_a_step_in_the_first_sample_excites_the_dynamics():
    """It gives the frequency of a mode within a thousandth, if it is sampled often enough."""
    slow = 5.0 + np.sin(2.0 * np.pi * TIME)
    assert "dynamics" not in missing(record(slow, initial_voltage=0.0))
    assert "dynamics" not in missing(record(np.full(2000, 5.0), initial_voltage=0.0), record(slow))
    assert "can hardly show extra_resonance and lags" in missing(record(slow))
    said = missing(record(slow[::10], 1e-2, initial_voltage=0.0))
    assert "can hardly show extra_resonance, because the samples after the steps are too far apart" in said


UP = np.interp(np.arange(300), [50, 250], [0.0, 5.0])


@pytest.mark.parametrize("drive", [UP, -UP, np.repeat([0.0, 5.0], 100), np.full(100, 5.0)])
def test_a_drive_that_never_turns_back_does_not_show_the_loop(drive):
    (notice,) = one_way([record(drive, phase="ramp", initial_voltage=0.0)], [0])
    assert notice.severe


@pytest.mark.parametrize("continues", [True, False])
def test_a_record_that_turns_back_or_continues_one_shows_the_loop(continues):
    back = record(UP[::-1], continues=continues)
    assert not one_way([record(np.append(UP, UP[::-1]))], [0])
    assert (one_way([record(UP), back], [0, 1]) == ()) is continues
    assert one_way([record(UP), back], [0])
