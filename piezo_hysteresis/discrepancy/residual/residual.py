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

"""`residuals_on`: the residuals of some of the records of an experiment."""

from __future__ import annotations

from collections.abc import Sequence

from ...blocks.block import Array
from ...identification.fit.normal_equations import Nuisance, residuals
from ...identification.records.conditioning import with_conditioning
from ...model.model import Model
from ...record import Record


def residuals_on(model: Model, records: Sequence[Record], wanted: Sequence[int], nuisance: Nuisance) -> list[Array]:
    """Residuals of the records `wanted` [m], in free run, without the disturbances that are free in every record.

    Other records are only simulated if one of these continues them. A model that diverges raises a DivergenceError.
    """
    kept = with_conditioning(records, wanted)
    left = dict(zip(kept, residuals(model, [records[i] for i in kept], nuisance), strict=True))
    return [left[i] for i in wanted]
