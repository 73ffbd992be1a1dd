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

"""The structure beside a noise record, for a creeping stage of relays, which plays and operator only approximate."""

import re

import numpy as np
import pytest
from scipy import signal

from piezo_hysteresis.effects import HYSTERESIS, MEMORY, Arx, Creep, CreepTwoRates, Offset
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

RATE = 2000.0


def relays(level, count=40):
    """Preisach operator of relays between the levels -1.1 and 1.1; negative at first."""
    grid = 1.1 * (2.0 * np.arange(count) + 1.0) / count - 1.1
    up, down = (g[np.tril_indices(count, -1)] for g in np.meshgrid(grid, grid, indexing="ij"))
    weight = np.exp(-(up - down) / 0.35 - ((up + down) / 2.6) ** 2) * (1.0 + 0.2 * (up + down))
    weight *= 0.35 / weight.sum()
    state, moved = np.full(up.size, -1.0), np.empty(level.size)
    for i, now in enumerate(level):
        state[now >= up], state[now <= down] = 1.0, -1.0
        moved[i] = weight @ state
    return 0.65 * level + moved


def measured(drive, phase, seed):
    """Record of a Preisach stage of 15 µm for 0 to 10 V that creeps, with a mode of 180 Hz; it was driven before."""
    before = np.concatenate((np.linspace(1.0, -1.0, 200), np.linspace(-1.0, drive[0] / 5.0 - 1.0, 200)))
    w = relays(np.concatenate((before, drive / 5.0 - 1.0)))[before.size :]
    tau = 10.0 ** np.arange(-2.0, 2.0)
    follows = [signal.lfilter(*signal.bilinear([1.0], [t, 1.0], RATE), w - w[0]) for t in tau]
    w = w + 0.012 * np.sum(follows, axis=0)
    omega = 2.0 * np.pi * 180.0
    b, a = signal.bilinear([omega**2], [1.0, 0.04 * omega, omega**2], RATE)
    y = signal.lfilter(b, a, w, zi=signal.lfilter_zi(b, a) * w[0])[0]
    noise = 7.5e-9 * np.random.default_rng(seed).standard_normal(y.size)
    return Record(drive, 7.5e-6 * np.concatenate((y[:1], y[:-1])) + noise, 1.0 / RATE, phase)


def drives():
    """Drives of an experiment with a noise record [V]."""
    triangle = 0.5 + 0.5 * signal.sawtooth(2.0 * np.pi * np.arange(2000) / RATE, 0.5)
    low_pass = signal.butter(4, 150.0, fs=RATE, output="sos")
    noise = signal.sosfiltfilt(low_pass, np.random.default_rng(2).standard_normal(4000))
    fade = np.minimum(1.0, np.minimum(np.arange(4000), np.arange(4000)[::-1]) / 200.0)
    return {
        "triangle": np.concatenate((10.0 * triangle, 6.0 * triangle)),
        "noise": (5.0 + 5.0 * fade * noise / np.abs(noise).max())[:3000],
        "step": np.concatenate((np.zeros(200), np.full(500, 8.0))),
    }


@pytest.fixture(scope="module")
def experiment():
    return Experiment(tuple(measured(u, phase, k) for k, (phase, u) in enumerate(drives().items())))


@pytest.fixture(scope="module")
def found(experiment):
    return identify(experiment, memory=True)


def error_of(model):
    """RMS error on drives that are not in the experiment [m]: minor loops of 0.5 to 2.5 Hz, a sine of 20 Hz."""
    levels = np.interp(np.arange(4000) / RATE, np.arange(0.0, 2.1, 0.2), [0, 7, 5, 6.5, 2, 4, 0, 3, 1, 9, 0])
    sine = 3.5 - 3.5 * np.cos(2.0 * np.pi * 20.0 * np.arange(1000) / RATE)
    records = [measured(np.concatenate((np.zeros(100), u)), "minor", 9) for u in (levels, sine)]
    return np.sqrt(np.mean([np.var(r.displacement - model.simulate(r)[0]) for r in records]))


def test_other_drives_are_predicted_better_than_by_hysteresis_and_dynamics_alone(experiment, found):
    assert {MEMORY.name, Arx.name} <= {e.name for e in found.model.effects}
    assert {"creep", "creep_two_rates"} & {e.name for e in found.model.effects}
    assert error_of(found.model) < 0.6 * error_of(identify(experiment).model)


def test_the_fit_ends_where_no_play_leaves_its_bound_any_more(found):
    assert found.fit.converged


def test_the_message_says_whose_error_is_smaller_and_which_is_used(found):
    (said,) = (n.message for n in found.notices if n.message.startswith("on data left out"))
    first, second = (float(number) for number in re.findall(r"of ([0-9.]+)(?: times|;)", said))
    assert second < first and said.endswith("; the second is used")


def test_the_dynamics_hold_the_mode_that_the_noise_shows(found):
    poles = found.model.effect(Arx).poles
    frequency = np.abs(np.angle(poles)) * RATE / (2.0 * np.pi)
    warped = RATE / np.pi * np.arctan(np.pi * 180.0 / RATE)  # by the bilinear transform
    assert np.abs(frequency - warped).min() < 1.0


def published(*others, lasts=1):
    """Records of a stage of the published form with further effects, with noise of 5 nm; every drive stays at its end.

    They last `lasts` times as long as the drives.
    """
    loop = HYSTERESIS(p1=0.0, p2=0.6, A=0.5, beta=1.2, gamma=0.4)
    stage = Model((loop, *others, Arx(a=(-1.4, 0.6), b=(0.2,), delay=2.0)), 1.0 / RATE, 10.0, 1e-5)
    noise = np.random.default_rng(0)
    records = []
    for phase, u in drives().items():
        u = np.pad(u, (0, (lasts - 1) * u.size), "edge")
        clean = Record(u, np.zeros(u.size), 1.0 / RATE, phase)
        records.append(Record(u, stage.simulate(clean)[0] + 5e-9 * noise.standard_normal(u.size), 1.0 / RATE, phase))
    return Experiment(tuple(records))


def test_a_stage_of_the_published_form_keeps_it():
    experiment = published()
    found = identify(experiment, memory=True)
    assert [e.name for e in found.model.effects] == [HYSTERESIS.name, Arx.name, Offset.name]


def test_creep_beside_the_operator_is_not_taken_for_a_slow_pole():
    """Dynamics that are estimated without creep have a pole that stands for it."""
    found = identify(published(Creep(gamma=0.005), lasts=4), memory=True)
    assert found.free_run_error < 1.05 * 5e-9
    names = {e.name for e in found.model.effects}
    assert HYSTERESIS.name in names and {Creep.name, CreepTwoRates.name} & names
    for name in (n for n in found.fit.names if n.startswith("creep") and "gamma" in n):
        low, high = found.fit.interval(name)
        assert low < 0.005 < high
