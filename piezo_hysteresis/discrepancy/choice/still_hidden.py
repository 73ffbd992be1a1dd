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

"""Effects that later phases may still show, although the records so far show nothing.

The records so far give an upper bound of the size of a slow effect. The effect is excluded if, with this size, the
error of the later phases would stay at the noise floor, so that these phases give no information.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy

from ...effects import Effect
from ...identification.fit.covariance import sandwich
from ...identification.fit.form_uncertainty import PIECES
from ...identification.fit.normal_equations import grams
from ...identification.protocol.phases import ProtocolPhase
from ...identification.records.noise_floor import ADEQUATE
from ...identification.training.adjusted_numbers import adjusted_numbers, directions
from ...identification.training.joint_fit import FAILURES
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from ...record import Record
from ..search.candidates import starts_of


def still_hidden(
    model: Model,
    training_data: TrainingData,
    effects: Iterable[type[Effect]],
    phases: Sequence[ProtocolPhase],
    clock: float,
    error_rate: float,
) -> set[str]:
    """Public names of the effects that a later phase may show.

    Parameters
    ----------
    model : Model
        Model that describes the records so far.
    training_data : TrainingData
        Records so far.
    effects : iterable of Effect classes
        Effects to test.
    phases : sequence of ProtocolPhase
        Later phases, at least one.
    clock : float
        Stage time at which the first of them begins [s].
    error_rate : float
        Accepted probability that a size is above its bound.

    Notes
    -----
    The size s of an effect has the estimate ŝ and the covariance Σ of a joint linear fit with all parameters of the
    model. A record counts as `PIECES` independent values. If the effect has the size s, the parameters of the model
    without it have changed to imitate it in the records so far. M is the mean product, over the later phases, of the
    sensitivities that remain after this change. The possible error of the effect there is R² = tr(M (ŝŝᵀ + z² Σ))/f²,
    with the smallest noise floor f so far. It cannot be seen if R² is at most `ADEQUATE` − 1.
    """
    z = float(scipy.stats.norm.isf(0.5 * error_rate))
    floor = float(np.min(training_data.floors))
    starts_at = clock + np.cumsum([0.0, *(p.duration for p in phases[:-1])])
    records = [p.as_record(float(t)) for p, t in zip(phases, starts_at, strict=True)]
    found = set[str]()
    for effect in effects:
        starts = starts_of(effect, training_data.extent) if effect.channel is None else ()
        for start in (s for s in starts if s.is_off):
            try:
                may_show = _may_show(model.with_effect(start), start.name, model, training_data, records, z) / floor**2
            except FAILURES:
                may_show = np.inf
            if may_show > ADEQUATE - 1.0:
                found.add(effect.public_name())
                break
    return found


def _may_show(
    extended: Model, effect: str, model: Model, training_data: TrainingData, records: Sequence[Record], z: float
) -> float:
    """Mean square of the possible error of an effect in the later records, with equal weights [m²]."""
    base = adjusted_numbers(model, training_data)
    sizes = [
        n
        for n in adjusted_numbers(extended, training_data)
        if n.startswith(f"{effect}.") and extended.row(n).off is not None
    ]
    q = len(base)
    columns = directions(model, base, len(sizes))
    total, meat = np.zeros((len(columns),) * 2), np.zeros((columns.shape[1],) * 2)
    products = grams(extended, training_data.records, [*base, *sizes], training_data.free_with(extended))
    for gram, size_of_error in zip(products, training_data.floors, strict=True):
        if np.isfinite(size_of_error):
            weighted = gram.matrix / (gram.size * size_of_error**2)
            total += weighted
            meat += max(1.0, weighted[-1, -1]) / PIECES * (columns.T @ weighted @ columns)
    bread = columns.T @ total @ columns
    own = slice(q, q + len(sizes))
    estimate = (sandwich(bread, bread, columns) @ total[:, -1])[own]
    spread = sandwich(bread, meat, columns)[own, own]
    kept = bread.shape[0] - len(sizes)
    alone = columns[:q, :kept]
    inner = bread[:kept, :kept]
    left = np.vstack((-sandwich(inner, inner, alone) @ total[:q, own], np.eye(len(sizes))))
    reach = left @ (np.outer(estimate, estimate) + z**2 * spread) @ left.T
    shown = grams(extended, records, [*base, *sizes])
    return float(np.mean([np.sum(g.matrix[:-1, :-1] * reach) / g.size for g in shown]))
