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

"""`AppliedState`: the state of the model after all voltages that were applied to the stage."""

from __future__ import annotations

import numpy as np

from ...acquisition.sample_block import SampleBlock
from ...errors import DivergenceError, ModelError, PiezoError
from ...model.chain import ChainState
from ...model.model import Model
from ...online.predictor import Predictor
from ...online.voltage_history import is_held


class AppliedState:
    """Runs the model with the stage, so that the plan of a path starts from the present hysteresis and creep.

    A new model is first run over the voltages that were applied before it was received.

    Parameters
    ----------
    sample_period : float
        Of the driver [s].

    Attributes
    ----------
    voltage : float
        Newest voltage [V].
    is_held : bool
        Whether the newest block was at one voltage.
    noise : float
        Rms noise of the sensor, from its changes between samples while the drive is held; 0 before that [m].
    """

    def __init__(self, sample_period: float) -> None:
        self.sample_period = sample_period
        self.voltage = self.noise = 0.0
        self.is_held = False
        self._predictor = Predictor(sample_period)
        self._wanted: Model | None = None
        self._refusal = "no model was received"

    @property
    def is_ready(self) -> bool:
        """Whether the newest model has been run over the applied voltages, or was refused there."""
        return not self._predictor.is_swapping

    @property
    def missing(self) -> str:
        """Why there is no model; empty where one is in use, or is being run over the applied voltages."""
        return "" if self._predictor.newest_model else self._refusal

    @property
    def is_known(self) -> bool:
        """False while voltages that were not received influence the state."""
        return not self._predictor.warming_up

    @property
    def model(self) -> Model:
        """Present model.

        Raises
        ------
        ModelError
            If no model was received, or the model diverged on the applied voltages.
        """
        if self._predictor.model is None:
            raise ModelError(self.missing or "the model is being run over the applied voltages")
        return self._predictor.model

    @property
    def state(self) -> ChainState:
        """State of the model after the last sample.

        Raises
        ------
        ModelError
            If there is none.
        """
        if self._predictor.state is None:
            raise ModelError("no samples were received; is the driver active?")
        return self._predictor.state

    def follow(self, model: Model) -> None:
        """Use this model as soon as it has been run over the applied voltages.

        Raises
        ------
        ModelError
            If it is of another sample period.
        """
        check_period(model, self.sample_period)
        if model is not self._wanted:
            self._wanted = model
            self._predictor.swap(model)

    def take(self, block: SampleBlock) -> PiezoError | None:
        """Run the model over a block. Over lost samples the last voltage is held.

        Returns
        -------
        PiezoError or None
            Why a model is not used from now on: the present one diverges, or a new one did on the applied voltages.

        Raises
        ------
        RecordError
            On samples that no stage can give.
        """
        refused: PiezoError | None
        try:
            refused = self._predictor.predict(
                int(block.index[0]),
                block.stamp + round(float(block.time[0]) * 1e9),
                block.voltage,
                block.displacement,
                follows_gap=block.follows_gap,
                settled=block.index[0] == 0 or block.phase[0] == 0,
            ).refused
        except DivergenceError as error:
            refused = error
        self.voltage, self.is_held = float(block.voltage[-1]), is_held(block.voltage)
        if block.size > 1 and self.is_held:
            self.noise = float(np.sqrt(0.5 * np.mean(np.diff(block.displacement) ** 2)))
        if refused is not None:
            self._refusal = f"the model was refused on the voltages that were applied: {refused}; identify again"
        return refused


def check_period(model: Model, period: float) -> None:
    """Check that the driver has the sample period of the model.

    Raises
    ------
    ModelError
        If the periods differ; the message names both.
    """
    if abs(period / model.sample_period - 1.0) > 1e-6:
        raise ModelError(
            f"model: got a sample period of {model.sample_period:g} s, expected {period:g} s (the driver's); "
            "identify at the rate of the driver"
        )
