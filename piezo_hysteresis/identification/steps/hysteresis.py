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

"""Step 3: the hysteresis by nonlinear least squares, with computed start values (paper, Sec. 3.4).

The operator in the role of the hysteresis defines the parameters and computes their start values.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import Arx, Loop
from ...model.model import Model
from ...record import Record
from ..fit.fit import Fit, fit
from ..fit.normal_equations import Nuisance
from ..records.conditioning import records_to_fit


def loop_of(record: Record, model: Model, weight: float = 1.0) -> Loop:
    """Input and output of the hysteresis in a slow record: v = u/voltage_scale, w(t) = y(t + lag)/gain.

    Parameters
    ----------
    record : Record
        Record in which the dynamics are only a gain and a lag, e.g. the 1 Hz triangle.
    model : Model
        Its scales, and the dc gain and group delay of its `Arx`, are used; the paper uses K and d only.
    weight : float
        Weight in the search.
    """
    arx = model.effect(Arx)
    time = record.sample_period * np.arange(record.size)
    y = np.interp(time + arx.group_delay * model.sample_period, time, record.displacement)
    scale = model.voltage_scale
    return Loop(
        record.voltage / scale,
        y / (model.displacement_scale * arx.dc_gain),
        record.continues,
        record.settled_voltage / scale,
        weight,
    )


def hysteresis_numbers(model: Model) -> list[str]:
    """Numbers of the hysteresis that a fit adjusts, by the names of the model: ``"bouc_wen.A"``."""
    return [f"{model.hysteresis.name}.{n}" for n in model.hysteresis.fitted_names()]


def fit_hysteresis(model: Model, records: Sequence[Record], loops: Collection[int]) -> Fit:
    """Step 3: fit the hysteresis parameters, with fixed dynamics and a free offset per record.

    Parameters
    ----------
    model : Model
        Scales, dynamics, and the form of the hysteresis; its values are not used.
    records : sequence of Record
        The experiment, in order.
    loops : collection of int
        Indices of the slow records to fit; the records that they continue determine the state.

    Returns
    -------
    Fit
        Fit of the hysteresis parameters to all samples.
    """
    kept, floors = records_to_fit(records, [1.0] * len(records), loops)
    loops_ = [loop_of(r, model, float(np.isfinite(f))) for r, f in zip(kept, floors, strict=True)]
    model = model.with_hysteresis(model.hysteresis.started(loops_))
    return fit(model, kept, hysteresis_numbers(model), floors=floors, nuisance=Nuisance(offset=True))
