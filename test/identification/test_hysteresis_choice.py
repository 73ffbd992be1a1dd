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

"""The choice between plays and the state of the operator, with a stage of relays, which both only approximate."""

import numpy as np
from scipy import signal

from piezo_hysteresis.effects import MEMORY
from piezo_hysteresis.identification.identify import identify
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
    """Record of a Preisach stage of 15 µm for 0 to 10 V with a mode of 180 Hz, which was driven before."""
    before = np.concatenate((np.linspace(1.0, -1.0, 200), np.linspace(-1.0, drive[0] / 5.0 - 1.0, 200)))
    w = relays(np.concatenate((before, drive / 5.0 - 1.0)))[before.size :]
    omega = 2.0 * np.pi * 180.0
    b, a = signal.bilinear([omega**2], [1.0, 0.04 * omega, omega**2], RATE)
    y = signal.lfilter(b, a, w, zi=signal.lfilter_zi(b, a) * w[0])[0]
    noise = 7.5e-9 * np.random.default_rng(seed).standard_normal(y.size)
    return Record(drive, 7.5e-6 * np.concatenate((y[:1], y[:-1])) + noise, 1.0 / RATE, phase)


def test_the_joint_fit_with_plays_ends_where_no_play_leaves_its_bound_any_more():
    triangle = 0.5 + 0.5 * signal.sawtooth(2.0 * np.pi * np.arange(2000) / RATE, 0.5)
    low_pass = signal.butter(4, 150.0, fs=RATE, output="sos")
    noise = signal.sosfiltfilt(low_pass, np.random.default_rng(2).standard_normal(4000))
    fade = np.minimum(1.0, np.minimum(np.arange(4000), np.arange(4000)[::-1]) / 200.0)
    drives = {
        "triangle": np.concatenate((10.0 * triangle, 6.0 * triangle)),
        "noise": (5.0 + 5.0 * fade * noise / np.abs(noise).max())[:3000],
        "step": np.concatenate((np.zeros(200), np.full(500, 8.0))),
    }
    experiment = Experiment(tuple(measured(u, phase, k) for k, (phase, u) in enumerate(drives.items())))
    found = identify(experiment, memory=True)
    assert MEMORY.name in found.model
    assert found.fit.converged
