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

"""Simulate the stage of the paper at any drive, in blocks: `python simulate.py`."""

from pathlib import Path

import numpy as np

from piezo_hysteresis import load

model = load(Path(__file__).parents[1] / "config" / "published_stage.yaml")

time = model.sample_period * np.arange(25_000)
voltage = 3.5 + 2.5 * np.sin(2 * np.pi * 100.0 * time)  # V

state = model.rest(voltage[0])  # settled at the first voltage
blocks = []
for u in np.array_split(voltage, 50):  # bit for bit the same for any cutting
    y, state = model.run(u, state)
    blocks.append(y)
displacement = np.concatenate(blocks)  # m

print(f"{displacement.size} samples, stroke {np.ptp(displacement[-5000:]) * 1e6:.3f} µm")
