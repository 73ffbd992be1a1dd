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

"""The gauge of a model: its scales and G(1), which it can be expressed in without a change of its displacement."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects import Arx
from ...errors import ParameterError
from ...model.model import Model
from ...record import Record
from .fit import Fit


@dataclass(frozen=True, slots=True)
class Gauge:
    """What an identified model is expressed in.

    Parameters
    ----------
    voltage_scale : float
        v = u / voltage_scale, positive [V].
    displacement_scale : float
        Displacement at normalised output 1, positive [m].
    gain : float
        G(1), not 0.
    """

    voltage_scale: float
    displacement_scale: float
    gain: float

    @classmethod
    def natural(cls, records: Sequence[Record], loops: Collection[int]) -> Gauge:
        """Gauge in which v and w are at most about 1, and w rises with v: that of the prior of a structure.

        Parameters
        ----------
        records : sequence of Record
            The experiment; its displacement changes.
        loops : collection of int
            Indices of the records that show in which direction the stage moves.
        """
        along = sum(float(np.cov(records[i].voltage, records[i].displacement, bias=True)[0, 1]) for i in loops)
        return cls(
            max(float(np.max(np.abs(r.voltage))) for r in records),
            max(float(np.ptp(r.displacement)) for r in records),
            -1.0 if along < 0.0 else 1.0,
        )

    def require_sign(self, natural: Gauge) -> None:
        """Raise ParameterError if G(1) has not the sign of the natural gauge."""
        if self.gain * natural.gain < 0.0:
            raise ParameterError(
                f"gain: got {self.gain:g}, with which w falls with the drive; expected {-self.gain:g} for this stage, "
                "because plays have no negative weights"
            )

    def of_model(self, model: Model) -> Model:
        """A model of hysteresis, creep and dynamics in this gauge; its displacement stays the same.

        Raises
        ------
        ParameterError
            If a parameter is beyond its bounds in this gauge.
        """
        values = {name: value * self._factor(model, name) for name, value in model.values().items()}
        model = replace(model, voltage_scale=self.voltage_scale, displacement_scale=self.displacement_scale)
        return model.with_values(values)

    def of_fit(self, fit: Fit) -> Fit:
        """A fit of such a model in this gauge."""
        factors = np.array([self._factor(fit.model, name) for name in fit.names])
        covariance = fit.covariance * np.outer(factors, factors)
        return replace(fit, model=self.of_model(fit.model), covariance=covariance, linearised=None)

    def _factor(self, model: Model, name: str) -> float:
        """Factor by which a parameter changes from the gauge of `model` to this one."""
        gain = self.gain / model.effect(Arx).dc_gain
        if name.startswith(f"{Arx.name}.b["):
            return gain
        drive, output = model.row(name).powers
        size = model.displacement_scale / (gain * self.displacement_scale)
        return float((model.voltage_scale / self.voltage_scale) ** drive * size**output)
