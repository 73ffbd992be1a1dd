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

"""A plant of three axes, written here: a full matrix of gains behind a lag and a play in every actuator."""

import numpy as np

from piezo_hysteresis.record import Record

GAINS = 1e-6 * np.array([[-2.8, 1.5, -3.5], [0.5, -3.5, -4.0], [-3.5, -4.5, 1.7]])
LAG, WIDTH, SHARE = 0.5, 0.05, 0.4


def plant(seed, share=SHARE, size=3000, gains=GAINS):
    outputs, inputs = gains.shape
    u = 0.2 * np.random.default_rng(seed).standard_normal((size, inputs))
    x, h, y = np.zeros(inputs), np.zeros(inputs), np.empty((size, outputs))
    for k in range(size):
        x = LAG * x + (1 - LAG) * u[k]
        h = np.clip(h, x - WIDTH, x + WIDTH)
        y[k] = gains @ (x + share * h)
    others = {f"{q}_{i + 1}": a[:, i] for q, a in (("voltage", u), ("displacement", y)) for i in range(1, a.shape[1])}
    return Record(u[:, 0], y[:, 0], 1e-3, f"noise_{seed}", channels=others)
