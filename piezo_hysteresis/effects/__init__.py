"""The catalogue: one physical effect per file, listed here in the order of the chain.

u → [timing] → [amplifier] → v → [backlash] → [input polynomial + h + plays] → w → [creep] → [G, extra mode, softening]
→ x → [sensor] → [other axis, drift, hum] → y
"""

from __future__ import annotations

from .arx import Arx
from .bouc_wen import BoucWen
from .effect import Effect, Place, Setting
from .offset import Offset
from .published_bouc_wen import PublishedBoucWen

CHAIN: tuple[type[Effect], ...] = (
    BoucWen,
    PublishedBoucWen,
    Arx,
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
    "BoucWen",
    "Effect",
    "Offset",
    "Place",
    "PublishedBoucWen",
    "Setting",
]
