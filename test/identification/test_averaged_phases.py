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

"""Slow phases that were stored as averages: the intervals of `identify` contain the truth, as those of all samples."""

import numpy as np
import pytest
from scipy import signal

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD, SIZE = 1e-4, 6000
TRUTH = {"A": -0.35, "beta": 3.0, "gamma": -0.6, "p1": -0.06, "p2": 1.15}
STAGE = Model((BoucWen(**TRUTH), Arx(a=[-1.5, 0.7], b=[0.12, 0.08], delay=2.0)), PERIOD, 10.0, 2e-5)


def recorded(seed, *, averaged, stage=STAGE):
    """Step, noise, triangles and minor loops; the last two at a seventh and a tenth of the rate."""
    rng, t = np.random.default_rng(seed), np.arange(SIZE) / SIZE
    noise = signal.sosfiltfilt(signal.butter(2, 0.6, output="sos"), rng.standard_normal(SIZE))
    edge = np.minimum(1.0, np.minimum(20.0 * t, 20.0 * (1.0 - t)))
    drives = {
        "step": 5.0 * ((8.0 * t).astype(int) % 2),
        "noise": np.concatenate((np.linspace(0.0, 5.0, 600), 5.0 + 1.2 * noise * edge)),
        "triangle": 10.0 * np.select([t < 1 / 3, t < 2 / 3], [1.0, 0.7], 0.4) * (1 - np.abs(1 - 2 * (3 * t % 1))),
        "minor_loops": 7.0 * (1 - np.abs(1 - 2 * t)) + 3.0 * (1 - np.abs(1 - 2 * (7 * t % 1))),
        "validation": 3.0 * (1 - np.cos(4 * np.pi * t)) + 1.5 * (1 - np.cos(14 * np.pi * t)),
    }
    records = {}
    for phase, drive in drives.items():
        y = stage.simulate(drive) + 1e-8 * rng.standard_normal(drive.size)
        records[phase] = Record(drive, y, PERIOD, phase)
    if averaged:
        for phase, factor in (("triangle", 7), ("minor_loops", 10)):
            records[phase] = records[phase].decimate(factor)
    return Experiment(tuple(records.values()))


@pytest.mark.parametrize("phases", [None, ("step", "triangle", "minor_loops", "validation")], ids=["all", "no noise"])
@pytest.mark.parametrize("averaged", [True, pytest.param(False, marks=pytest.mark.soak)])
def test_the_loop_is_as_known_from_averages_as_from_all_samples(averaged, phases):
    """The turns between two averages were taken for a wider loop, in every recording."""
    experiment = recorded(0, averaged=averaged)
    kept = experiment if phases is None else [r for r in experiment if r.phase in phases]
    found = identify(kept, voltage_scale=10.0, displacement_scale=2e-5, gain=1.0)
    assert any(n.kind == "intersample_error" for n in found.notices) is averaged
    for name, true in TRUTH.items():
        low, high = found.fit.interval(f"bouc_wen.{name}")
        assert low < true < high, name


def test_the_structure_is_chosen_without_the_turns_that_averages_have_lost():
    """Beside a step without noise, the loop was wider, and the validation was predicted with three times the error."""
    stage = STAGE.with_effect(Arx(a=[-0.8], b=[0.2], delay=2.0))
    step, _, triangle, _, validation = recorded(0, averaged=False, stage=stage)
    phases = [step, triangle.decimate(20), validation]
    found = identify(phases, voltage_scale=10.0, displacement_scale=2e-5, memory=True)
    assert any(n.kind == "intersample_error" for n in found.notices)
    assert found.free_run_percent < 0.08
    for name, true in TRUTH.items():
        low, high = found.fit.interval(f"bouc_wen.{name}")
        assert low < true < high, name
