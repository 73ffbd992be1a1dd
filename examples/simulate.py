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
