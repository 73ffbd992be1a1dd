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

"""The sample periods at which a model holds, as its provenance states them.

Dynamics that were identified from broadband records belong to one period, that of the model. Without them the dynamics
are a lag, which holds at every period of the records, and the period of the model is only the shortest of these.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..effects import Discretisation
from ..errors import ModelError
from .chain import Chain

if TYPE_CHECKING:
    from .model import Model

EQUAL_PERIODS = 1e-3
"""Relative difference up to which two sample periods count as one."""

KEPT_CHAINS = 32
"""Number of sample periods whose chains a model keeps."""

SAMPLE_PERIODS = "sample_periods"
"""Key of the provenance: the periods of the records of a model without dynamics of its own period [s]."""


def identified_periods(periods: Iterable[float]) -> Mapping[str, str]:
    """Provenance of a model that was identified without broadband records.

    >>> identified_periods((1e-3, 1e-4, 1e-3))
    {'sample_periods': '0.0001 0.001'}
    """
    return {SAMPLE_PERIODS: " ".join(f"{p:.9g}" for p in sorted(set(periods)))}


def stated_period(model: Model, given: float | None) -> float:
    """The period of samples without a stated one: `given`, or that of the model if it has one of its own.

    Raises
    ------
    ModelError
        If none is given and the model was identified from records of several periods.
    """
    if given is not None:
        return given
    known = model.provenance.get(SAMPLE_PERIODS, "").split()
    if len(known) > 1:
        raise ModelError(
            f"sample period: got none, expected that of the samples; the model was identified at {', '.join(known)} s "
            "and has no period of its own; give sample_period"
        )
    return model.sample_period


def chain_period(model: Model, sample_period: float, running: float | None) -> float:
    """The period [s] of the chain for samples of `sample_period`: that of the model, or `running`, if they are equal.

    Clocks and files state one period with different last digits.

    Raises
    ------
    ModelError
        If the samples come faster than the model's.
    """
    for known in (model.sample_period, running):
        if known is not None and abs(sample_period / known - 1.0) <= EQUAL_PERIODS:
            return known
    if not model.sample_period < sample_period < np.inf:
        raise ModelError(
            f"sample period: got {sample_period:g} s, expected {model.sample_period:g} s (the model's) or more; "
            "decimate the record or identify at its rate"
        )
    return sample_period


class ChainCache:
    """Builds the chain of a model at a sample period, and keeps it for the next time.

    Parameters
    ----------
    model : Model
        Its effects and scales.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._kept: dict[float, Chain] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def at(self, period: float) -> Chain:
        """The chain at a sample period [s]."""
        if period not in self._kept:
            model = self._model
            setting = Discretisation(period, model.sample_period, model.voltage_scale, model.displacement_scale)
            chain = Chain(model.effects, setting)
            if len(self._kept) == KEPT_CHAINS:
                del self._kept[next(iter(self._kept))]
            self._kept[period] = chain
        return self._kept[period]
