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

"""`DiagnosisState`: the experiment and the options of a diagnosis, between two of its steps."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..effects import Effect
from ..identification.fit.fit import Progress
from ..identification.fit.form_uncertainty import PIECES
from ..identification.records.excitation_check import moves
from ..identification.records.noise import VOLTAGE_NOISE
from ..model.model import Model
from ..record import CONDITIONING, Experiment

IDLE = ("idle", "hold", CONDITIONING)
"""Phases that only bring the stage from one state to another."""


@dataclass(frozen=True, eq=False, slots=True)
class DiagnosisState:
    """The experiment and the options of a diagnosis, between two of its steps.

    The options are those of `diagnose`. The search has to end at the time `end` on the clock of `time.monotonic` [s];
    `given` is the experiment as it was recorded, before it was prepared.
    """

    experiment: Experiment
    model: Model | None
    effects: Collection[type[Effect]]
    progress: Progress
    end: float = np.inf
    explicit_step: bool = False
    given: Experiment | None = None

    @property
    def usable(self) -> list[int]:
        """Indices of the records to compare: no idle phases, and short or truncated ones if there are no others."""
        informative = [i for i, r in enumerate(self.experiment) if r.phase not in IDLE]
        whole = [i for i in informative if not self.experiment[i].truncated]
        return [i for i in whole if self.experiment[i].size >= PIECES] or whole or informative

    @property
    def moving(self) -> list[int]:
        """Indices of the usable records in which the drive moves."""
        return [i for i in self.usable if moves(self.experiment[i])]

    @property
    def corrects_intersample_error(self) -> bool:
        """Whether the inter-sample error is corrected; not with a noisy voltage, whose averages reverse at random."""
        return all(n.kind != VOLTAGE_NOISE for n in self.experiment.notices)
