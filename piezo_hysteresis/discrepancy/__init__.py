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

"""The gap finder: shows where a model is wrong, names the missing effect, and measures the gap after adding it.

`noise_floor` (residual of a perfect model) → `localise` (where the residual is large) → `candidates` (score test) →
`refit` → `selection` (add, repeat, stop) → `gap` (before and after, on test records) → `next_experiment`. `diagnose`
runs them all.
"""

from __future__ import annotations

from ..identification.records.noise_floor import floors, noise_floors, stroke
from .diagnose import diagnose
from .diagnosis import Diagnosis
from .gap import Gap, measure_gap
from .localise import ResidualShare, localise
from .search.selection import select
from .search.selection_result import Selection
from .verdict import Conclusion, Verdict

__all__ = [
    "Conclusion",
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
