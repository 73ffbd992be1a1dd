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

"""`Warmup`: brings a model to the present state of the stage by running it over the voltage history."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ..blocks.kernel import on_compilation
from ..effects import BY_NAME, CHAIN
from ..errors import PiezoError
from ..model.chain import ChainState
from ..model.free_run import after_hold
from ..model.model import Model
from .sensor_offset import SensorOffset
from .voltage_history import VoltageHistory

Array = NDArray[np.float64]


class Warmup:
    """Runs a model over the history in pieces, between the blocks of the stream.

    Parameters
    ----------
    model : Model
        Model to bring up to date.
    history : VoltageHistory
        History of the stream, which may grow during the run.
    zero : SensorOffset
        Offset whose window gives the samples for `mean`.
    offset : float, optional
        Sensor minus model [m], if known.

    Attributes
    ----------
    state : ChainState
        State at the end of the stream, once `advance` returned True.

    Raises
    ------
    ModelError
        If the stream is faster than the model.
    """

    def __init__(self, model: Model, history: VoltageHistory, zero: SensorOffset, offset: float | None = None) -> None:
        self.model, self.chain = model, model.at(history.sample_period)
        self.zero, self.offset, self._history = zero, offset, history
        self._slow = model.at(history.factor * history.sample_period) if history.factor > 1 else self.chain
        self._position = history.start
        self._running = self._slow
        self._sum, self._weight = 0.0, 0
        rest = history.rest_voltage
        self._held = history.held_until(history.start)
        time = (history.start + self._held) * history.sample_period
        self.state: ChainState = self._slow.rest(rest, time, since=0.0)
        if zero.start < history.start:
            settled, _ = self._slow.run(np.array([rest]), self.state)
            self._add(settled, zero.start, history.start - zero.start)

    @property
    def mean(self) -> float | None:
        """Mean prediction [m] over the window; None if the history begins after it."""
        return self._sum / self._weight if self._weight else None

    def known_offset(self, present: SensorOffset) -> SensorOffset | None:
        """The present offset of the stream as that of this model; None where it has to be measured again."""
        if self.offset is not None:
            return SensorOffset.known(self._history.count, self.offset)
        if self.zero is not present or self.mean is None:
            return None
        present.remodel(self.mean)
        return present

    def advance(self, values: int) -> bool:
        """Run the model over the next piece of the history.

        Parameters
        ----------
        values : int
            Number of voltages, averaged or at the full rate.

        Returns
        -------
        bool
            True when the model has reached the end of the history.

        Raises
        ------
        DivergenceError
            If the model diverges.
        """
        while values > 0:
            self._position = max(self._position, self._history.start)
            factor, voltage = self._history.read(self._position, values)
            chain = self._slow if factor > 1 else self.chain
            if chain is not self._running:
                self.state, self._running = chain.resume(self.state), chain
            if (held := self._history.held_until(self._position)) > self._held:
                duration = (held - self._held) * self._history.sample_period
                self.state, self._held = after_hold(self.model, self.state, self.state.inputs[0], duration), held
            if voltage.size == 0:
                return True
            voltage = voltage[: max(1, (self._history.next_hold(self._position) - self._position) // factor)]
            y, self.state = chain.run(voltage, self.state)
            self._add(y, self._position, factor)
            self._position += factor * voltage.size
            values -= voltage.size
        return self._position == self._history.count

    def _add(self, y: Array, position: int, factor: int) -> None:
        first = max(0, -(-(self.zero.start - position) // factor))
        last = max(first, min(y.size, -(-(self.zero.stop - position) // factor)))
        self._sum += factor * float(y[first:last].sum())
        self._weight += factor * (last - first)


def compile_kernels(inform: Callable[[str], object] = str) -> None:
    """Run every effect once at the fast and at the slow rate, so that its kernels are compiled before a stream begins.

    An effect that cannot run in this test model (softening needs a resonance) is compiled when it is first used.

    Parameters
    ----------
    inform : callable
        Called with one line of text when a kernel is compiled. It is not called if all kernels are loaded from disk.
    """
    with on_compilation(lambda: inform("compiling kernels, once; this takes about 30 s")):
        _run_every_effect()


def _run_every_effect() -> None:
    for kind in CHAIN:
        rows = [p for p in kind.parameters if p.off is not None and not p.is_array]
        host = (BY_NAME[kind.host](),) if kind.host else ()
        with suppress(PiezoError):
            switched_on = kind(**{p.name: min(p.upper, p.off + 0.1 * p.scale) for p in rows if p.off is not None})
            model = Model((switched_on, *host), 1e-3)
            for period in (1e-3, 1e-2):
                chain = model.at(period)
                chain.run(np.linspace(0.0, 1.0, 8), chain.rest(0.0))
