"""The waveform on which the live residual is compared, the same before and after every new model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.excitation import hold, mixture, sine, steps, triangle


def probe(limits: DriveLimits) -> dict[str, NDArray[np.float64]]:
    """Slow loops, a fast sine, levels held, and a random mixture [V], by name: 8 s that no fit has seen."""
    parts = {
        "slow loops": triangle(limits, (1.0, 0.6), 1.0),
        "200 Hz": sine(limits, 200.0, 0.3, centre=0.5, amplitude=0.4),
        "levels held": steps(limits, (0.2, 0.8, 0.4), 1.0, slew_rate=limits.ramp_rate),
        "rest": hold(limits, 0.0, 0.5),
        "random mixture": mixture(limits, 1.5, seed=12345),
    }
    return {name: limits.from_safe_to_safe(part) for name, part in parts.items()}
