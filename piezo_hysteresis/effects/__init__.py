"""The catalogue: one physical effect per file, listed here in the order of the chain.

u → [timing] → [amplifier] → v → [backlash] → [input polynomial + h + plays] → w → [creep] → [G, extra mode, softening]
→ x → [sensor] → [other axis, drift, hum] → y
"""

from __future__ import annotations

from .arx import Arx
from .asymmetric_hysteresis import AsymmetricHysteresis
from .axis_coupling import AxisCoupling
from .bouc_wen import BoucWen
from .creep import Creep
from .effect import Effect, Place, Setting, Term
from .gain_drift import GainDrift
from .hysteresis_exponent import HysteresisExponent
from .initial_state import InitialState
from .mains_hum import MainsHum
from .offset import Offset
from .published_bouc_wen import PublishedBoucWen
from .rate_dependent_hysteresis import RateDependentHysteresis
from .thermal_drift import ThermalDrift
from .thermal_expansion import ThermalExpansion

CHAIN: tuple[type[Effect], ...] = (
    BoucWen,
    PublishedBoucWen,
    AsymmetricHysteresis,
    HysteresisExponent,
    RateDependentHysteresis,
    InitialState,
    Creep,
    Arx,
    GainDrift,
    ThermalDrift,
    ThermalExpansion,
    AxisCoupling,
    MainsHum,
    Offset,
)
"""Every effect, in the order in which it acts."""

BASELINE: tuple[type[Effect], ...] = (BoucWen, PublishedBoucWen, Arx, Offset)
"""The published model: what the others are missing from."""

CATALOGUE: tuple[type[Effect], ...] = tuple(e for e in CHAIN if e not in BASELINE)
"""The effects that a Hammerstein-MBW model can lack."""

BY_NAME: dict[str, type[Effect]] = {e.name: e for e in CHAIN}

__all__ = [
    "BASELINE",
    "BY_NAME",
    "CATALOGUE",
    "CHAIN",
    "Arx",
    "AsymmetricHysteresis",
    "AxisCoupling",
    "BoucWen",
    "Creep",
    "Effect",
    "GainDrift",
    "HysteresisExponent",
    "InitialState",
    "MainsHum",
    "Offset",
    "Place",
    "PublishedBoucWen",
    "RateDependentHysteresis",
    "Setting",
    "Term",
    "ThermalDrift",
    "ThermalExpansion",
]
