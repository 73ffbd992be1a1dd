"""The gap finder: shows where a model is wrong, names the missing effect, and measures the gap after adding it.

`noise_floor` (what no model can explain) → `localise` (where) → `candidates` (score test) → `refit` → `selection`
(add, repeat, stop) → `gap` (before, after, on unseen records) → `next_experiment`. `diagnose` runs them all.
"""

from __future__ import annotations

from .diagnose import diagnose
from .diagnosis import Diagnosis, Verdict
from .gap import Gap, measure_gap
from .residual.localise import ResidualShare, localise
from .residual.noise_floor import floors, noise_floors, stroke
from .search.selection import select
from .search.selection_result import Selection

__all__ = [
    "Diagnosis",
    "Gap",
    "ResidualShare",
    "Selection",
    "Verdict",
    "diagnose",
    "floors",
    "localise",
    "measure_gap",
    "noise_floors",
    "select",
    "stroke",
]
