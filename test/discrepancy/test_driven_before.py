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

"""Stages that made a loop before the experiment, which no record shows."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis import Experiment, Record, diagnose, identify
from piezo_hysteresis.effects import AmplifierBandwidth, Arx, BoucWen, HysteresisMemory
from piezo_hysteresis.model.model import Model

PERIOD = 1e-3
TIME = PERIOD * np.arange(3000)


def triangle(top, frequency):
    return top * (1.0 - np.abs(2.0 * (TIME * frequency % 1.0) - 1.0))


def drives():
    noise = np.convolve(np.random.default_rng(7).normal(size=TIME.size), np.ones(5) / 5, "same")
    fade = np.minimum(1.0, np.minimum(TIME, TIME[::-1]) / 0.3)
    return {
        "triangle_0": triangle(10.0, 1.0),
        "triangle_1": triangle(6.0, 1.0),
        "triangle_2": triangle(3.0, 2.0),
        "sine": 5.0 - 5.0 * np.cos(2.0 * np.pi * 5.0 * TIME),
        "noise": 5.0 * fade * (1.0 + noise / np.abs(noise).max()),
        "step": np.repeat((0.0, 3.0, 8.0, 10.0, 4.0, 0.0), 500),
    }


def measured(stage, before, records):
    """The records, with what a stage does after the drive `before`, and noise."""
    u = np.concatenate((before, *records.values()))
    (y,) = stage.free_run([Record(u, np.zeros(u.size), PERIOD)])
    y += 4e-9 * np.random.default_rng(0).normal(size=u.size)
    parts = Record(u, y, PERIOD).split(*np.cumsum([before.size, *(u.size for u in records.values())][:-1]).tolist())[1:]
    first, *later = (replace(part, phase=phase) for part, phase in zip(parts, records, strict=True))
    return Experiment((replace(first, continues=False), *later))


@pytest.mark.parametrize("is_given", [pytest.param(False, marks=pytest.mark.soak), True])
def test_a_named_model_begins_as_the_conditioning_shows(is_given):
    """No other record depends on the state before it; the extended model predicts it down to the noise."""
    stage = Model((BoucWen(), AmplifierBandwidth(tau=5e-3), Arx(a=(-0.5,), b=(0.5,), delay=1.0)), PERIOD, 10.0, 1e-5)
    before = np.concatenate((triangle(10.0, 1.0), np.zeros(200)))
    experiment = measured(stage, before, {"conditioning": triangle(10.0, 1.0), **drives()})
    found = diagnose(experiment, identify(experiment).model if is_given else None)
    assert found.names == ("amplifier_bandwidth",)
    first = found.experiment[0]
    (predicted,) = found.model.free_run([first])
    assert np.std(first.displacement - predicted) < 1.5 * 4e-9


def test_plays_of_a_stage_that_was_driven_before_are_named():
    """Plays of a stage that was never driven do not describe the first rise: other effects got the name."""
    plays = HysteresisMemory(c=(0.02,) * 6, reach=0.9, virgin=1.0)
    linear = BoucWen(A=0.0, gamma=0.0, p1=0.0, p2=1.4)
    stage = Model((linear, plays, Arx(a=(-0.5,), b=(0.5,), delay=1.0)), PERIOD, 10.0, 1e-5)
    before = np.concatenate((triangle(10.0, 1.0)[:1000], np.zeros(200)))
    records = []
    for k, (phase, u) in enumerate(drives().items()):
        (y,) = stage.free_run([Record(np.concatenate((before, u)), np.zeros(before.size + u.size), PERIOD)])
        noise = 4e-9 * np.random.default_rng(k).normal(size=u.size)
        records.append(Record(u, y[before.size :] + noise, PERIOD, phase))
    found = diagnose(Experiment(tuple(records)))
    assert found.names == ("hysteresis_memory",)
    assert found.gap.after < found.gap.floor
