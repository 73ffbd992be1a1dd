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

"""A lead is a shifted channel; what bends a loop, rings or holds is none."""

import numpy as np
import pytest
from scipy.signal import lfilter

from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import inspect

PERIOD = 1e-3
TIME = np.arange(8000) * PERIOD


def triangle(amplitudes):
    return np.repeat(amplitudes, TIME.size // len(amplitudes)) * (1.0 - np.abs(2.0 * np.mod(TIME, 1.0) - 1.0))


def loop(voltage, slope, loss, reversal, bend, slant):
    """Bouc-Wen state with the terms of asymmetric loops, by small steps of the drive."""
    state, states = 0.0, np.empty(voltage.size)
    fine = 8
    for i, (start, stop) in enumerate(zip(voltage[:-1], voltage[1:], strict=True), 1):
        d = (stop - start) / fine
        for _ in range(fine):
            drive = slope * d + bend * d * state + slant * abs(d) * abs(state)
            state += drive - loss * abs(d) * state - reversal * d * abs(state)
        states[i] = state
    states[0] = 0.0
    return states


def kinds(voltage, displacement, period=PERIOD, phase="triangle"):
    noise = 1e-9 * np.random.default_rng(0).normal(size=voltage.size)
    return {n.kind for n in inspect(Experiment((Record(voltage, displacement + noise, period, phase),)))}


@pytest.mark.parametrize("amplitudes", [(0.9, 0.9), (0.25, 0.5, 0.7, 0.95), (0.9, 0.6, 0.3, 0.1)])
@pytest.mark.parametrize(
    "terms", [(-0.5, 3.0, 0.5, 0.0, 0.0), (-0.35, 2.0, 0.3, 0.0, 0.0), (-0.6, 3.5, 1.0, -1.1, -0.8)]
)
def test_curved_loops_are_not_a_shifted_channel(amplitudes, terms):
    voltage = triangle(amplitudes)
    displacement = 1e-5 * (1.2 * voltage + loop(voltage, *terms))
    assert not {"leads", "late"} & kinds(10.0 * voltage, displacement)


@pytest.mark.parametrize("shift", [60, 120])
def test_a_channel_that_is_shifted_by_more_than_its_loops_bend_is_reported(shift):
    voltage = triangle((0.9, 0.9))
    displacement = 1e-5 * (1.2 * voltage + loop(voltage, -0.5, 3.0, 0.5, 0.0, 0.0))
    assert "leads" in kinds(10.0 * voltage[:-shift], displacement[shift:])


@pytest.mark.parametrize(("shift", "is_late"), [(0, False), (60, True)])
def test_a_late_channel_lags_in_every_phase_and_a_bent_loop_in_the_slow_one_alone(shift, is_late):
    phases = []
    for periods in (1, 4):
        voltage = np.sin(2 * np.pi * periods * np.arange(3000) / 1000)
        displacement = 1e-5 * (1.2 * voltage + loop(voltage, -0.6, 3.5, 1.0, -1.1, -0.8))
        late = np.roll(displacement, shift)[200:]
        phases.append(Record(10.0 * voltage[200:], late, PERIOD, f"sine_{periods}hz"))
    assert ("late" in {n.kind for n in inspect(Experiment(tuple(phases)))}) == is_late


def test_a_drive_above_the_resonance_does_not_lead():
    period, resonance = 5e-5, 320.0
    pole = np.exp(2 * np.pi * resonance * period * (-0.1 + 1j))
    mode = np.real(np.poly([pole, np.conj(pole)]))
    voltage = 4.0 * np.sin(2 * np.pi * 400.0 * np.arange(4000) * period)
    displacement = 1e-6 * lfilter([mode.sum()], mode, np.roll(voltage, 3))
    assert "leads" not in kinds(voltage[400:], displacement[400:], period, "sine_400hz")


def test_a_staircase_of_block_averages_does_not_lead():
    voltage = np.repeat([0.0, 2.0, 4.0, 6.0, 8.0, 6.0, 4.0, 2.0, 0.0, 5.0, 9.0, 0.0], 200)
    assert "leads" not in kinds(voltage, 1e-6 * voltage, 0.1, "staircase")


@pytest.mark.parametrize(("limit", "hum"), [(9.2, 0.0), (100.0, 0.003)])
def test_a_lead_that_another_record_contradicts_is_no_shifted_channel(limit, hum):
    """A limit of the amplifier bends the largest loop, and hum a slow one; a shifted channel shifts all of them."""
    time = np.arange(5000) * 2e-4
    phases = []
    for frequency, amplitude in ((2.0, 4.5), (10.0, 2.0), (50.0, 3.5)):
        voltage = 5.0 - amplitude * np.cos(2 * np.pi * frequency * time)
        over = np.maximum(voltage - limit + 0.8, 0.0)
        drive = 0.1 * (voltage - over + 0.8 * np.tanh(over / 0.8))
        state = 1.05 * drive - 0.05 * drive**3 + 0.5 * loop(drive, -0.75, 4.0, -0.8, 0.0, 0.0)
        state += hum * np.sin(2 * np.pi * 50.0 * time + 0.44) + 5e-4 * np.random.default_rng(0).normal(size=time.size)
        phases.append(Record(voltage, 1e-5 * state, 2e-4, f"sine_{frequency:g}hz"))

    def leading(records, shift):
        early = [Record(r.voltage[: -shift or None], r.displacement[shift:], 2e-4, r.phase) for r in records]
        return {n.phase for n in inspect(Experiment(tuple(early))) if n.kind == "leads"}

    assert not leading(phases, 0)
    assert leading(phases, 30)  # a real shift
    assert any(leading([record], 0) for record in phases)  # one record alone cannot tell
