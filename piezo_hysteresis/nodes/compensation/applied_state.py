"""`AppliedState`: the state that the model is in after every voltage that was applied to the stage."""

from __future__ import annotations

import numpy as np

from ...acquisition.sample_block import SampleBlock
from ...errors import ModelError
from ...model.chain import ChainState
from ...model.model import Model

_LONGEST_GAP = 1_000_000
"""Samples that were lost and are gone through with the voltage held; after more the stage counts as settled."""


class AppliedState:
    """Runs the model along, so that a path begins in the hysteresis and creep that the stage is in.

    Parameters
    ----------
    model : Model
        What the stage does.
    block : SampleBlock
        First samples; the stage counts as settled at the first voltage.
    """

    def __init__(self, model: Model, block: SampleBlock) -> None:
        self.model = model
        self.voltage = float(block.voltage[0])
        self._state = model.rest(self.voltage)
        self._next = int(block.index[0])
        self.take(block)

    @property
    def state(self) -> ChainState:
        """State after the last sample."""
        return self._state

    def take(self, block: SampleBlock) -> None:
        """Run over a block; samples that were lost are bridged with the voltage held."""
        missing = (int(block.index[0]) - self._next) % 2**32
        if missing > _LONGEST_GAP:
            self._state = self.model.rest(self.voltage)
        elif missing:
            _, self._state = self.model.run(np.full(missing, self.voltage), self._state)
        _, self._state = self.model.run(block.voltage, self._state)
        self.voltage = float(block.voltage[-1])
        self._next = (int(block.index[-1]) + 1) % 2**32

    def check_period(self, period: float) -> None:
        """Refuse a driver at another period.

        Raises
        ------
        ModelError
            Naming both periods.
        """
        if abs(period / self.model.sample_period - 1.0) > 1e-6:
            raise ModelError(
                f"model: got a sample period of {self.model.sample_period:g} s, expected {period:g} s (the driver's); "
                "identify at the rate of the driver"
            )
