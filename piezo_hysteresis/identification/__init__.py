"""Identification: excite, then delay, linear dynamics, hysteresis, and all of them jointly in free run.

What is played: `DriveLimits`, the shapes of `excitation`, a `Protocol` of phases. What is found, step by step:
`identify_delay`, `identify_arx`, `fit_hysteresis`, the published `three_steps`. What a user calls: `identify`.
"""

from __future__ import annotations

from .delay import Delay, identify_delay
from .drive import DriveLimits
from .dynamics import Dynamics, compare_orders, identify_arx
from .fit import Fit, fit
from .frequency_response import FrequencyResponse, periodic, welch
from .hysteresis import fit_hysteresis
from .identification import Identification
from .identify import identify
from .protocol import Phase, Protocol, paper, rich, short
from .three_steps import ThreeSteps, three_steps

__all__ = [
    "DriveLimits",
    "Phase",
    "Protocol",
    "paper",
    "short",
    "rich",
    "Delay",
    "identify_delay",
    "Dynamics",
    "identify_arx",
    "compare_orders",
    "FrequencyResponse",
    "welch",
    "periodic",
    "fit_hysteresis",
    "ThreeSteps",
    "three_steps",
    "Fit",
    "fit",
    "Identification",
    "identify",
]
