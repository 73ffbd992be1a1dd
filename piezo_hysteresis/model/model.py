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

"""`Model`: a chain of physical effects from drive voltage to displacement, with its scales."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModelError
from ..html_table import html_table
from ..picture import Picture, picture_of
from ..record import Experiment, Record
from .chain import Chain, ChainState, Channels
from .composition import Composition
from .free_run import free_run, linearised_run, simulated, standard_errors
from .parameter_covariance import ParameterCovariance
from .sample_periods import ChainCache, chain_period, stated_period
from .samples import channels_of, row

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Model(Composition):
    """Effects in the order of the physics. A model is frozen; ``with_…`` returns a new one.

    Parameters
    ----------
    effects : iterable of Effect
        In any order; each at most once.
    sample_period : float
        Period at which the discrete dynamics hold [s].
    voltage_scale : float
        v = u / voltage_scale [V].
    displacement_scale : float
        Displacement at normalised output 1 [m].
    provenance : mapping of str to str
        Where the values come from: date, data hash, free-run error, …
    covariance : ParameterCovariance, optional
        Of the numbers that were fitted; changes of numbers do not change it.

    Raises
    ------
    ModelError
        If an effect occurs twice, a term has no host, or a scale is not positive.

    Examples
    --------
    >>> from piezo_hysteresis.effects import Arx, BoucWen
    >>> model = Model((Arx(b=[0.5]), BoucWen()), sample_period=2e-5)
    >>> [e.name for e in model.effects]
    ['bouc_wen', 'arx']
    >>> y, state = model.run([0.0, 1.0], model.rest(0.0))
    >>> y2, state = model.run([2.0], state)
    """

    sample_period: float
    voltage_scale: float = 10.0
    displacement_scale: float = 1.0
    provenance: Mapping[str, str] = field(default_factory=dict)
    covariance: ParameterCovariance | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("sample_period", "voltage_scale", "displacement_scale"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ModelError(f"{name}: got {value!r}, expected a positive number")

    def __repr__(self) -> str:
        return f"Model({super().__repr__()}, {self.sample_period:g} s)"

    def _repr_html_(self) -> str:
        rows = ((name, f"{value:.6g}", self.row(name).unit) for name, value in self.values().items())
        return html_table(repr(self), ("parameter", "value", "unit"), rows)

    def plot(self, experiment: Experiment) -> Picture:
        """The free run against the measurement, phase by phase, with the residual and the 95 % band."""
        return picture_of(self, experiment)

    def at(self, sample_period: float, running: float | None = None) -> Chain:
        """The chain for samples of another period [s].

        Parameters
        ----------
        sample_period : float
            Of the samples to come [s]; it counts as the model's if the two differ by less than a thousandth.
        running : float, optional
            Of the samples before them [s]; likewise.

        Raises
        ------
        ModelError
            If the period is shorter than the model's.
        """
        return self._chains.at(chain_period(self, sample_period, running))

    @cached_property
    def _chains(self) -> ChainCache:
        return ChainCache(self)

    def rest(self, voltage: float, time: float = 0.0, sample_period: float | None = None) -> ChainState:
        """State of a stage settled at `voltage` [V], for samples of the period given.

        Parameters
        ----------
        voltage : float
            Drive voltage [V].
        time : float
            Of the first sample [s].
        sample_period : float, optional
            Of the samples to come [s]; default the model's.

        Raises
        ------
        ModelError
            If the period is shorter than the model's; or if none is given, and the model was identified at several
            periods and has none of its own.
        """
        return self.at(stated_period(self, sample_period)).rest(voltage, time)

    def run(
        self,
        voltage: ArrayLike,
        state: ChainState,
        channels: Channels | None = None,
        sample_period: float | None = None,
    ) -> tuple[Array, ChainState]:
        """Displacement [m] of the next samples, and the state after them.

        Bit-identical for every way of cutting the voltage into blocks.

        Parameters
        ----------
        voltage : (n,) array_like
            Drive voltage [V].
        state : ChainState
            From `rest`, or from the block before.
        channels : mapping, optional
            ``other_displacement`` [m] and ``temperature`` [K], shape (n,).
        sample_period : float, optional
            Of these samples [s]; default that of the state. After another one filters start settled.

        Raises
        ------
        ModelError
            On empty or non-finite samples, a period shorter than the model's, and a state of a model of other effects.
        RecordError
            On channels that a record would not have.
        DivergenceError
            If the output diverges.
        """
        before = state.sample_period
        chain = self.at(before if sample_period is None else sample_period, before)
        chain.require_own(state)
        if chain.setting.sample_period != before:
            state = chain.resume(state)
        u = row(voltage, "voltage")
        return chain.run(u, state, channels and channels_of(channels, u.size))

    @overload
    def simulate(self, records: Record | Iterable[Record], phase: str | None = None) -> list[Array]: ...

    @overload
    def simulate(self, records: Array | Sequence[float], *, sample_period: float | None = None) -> Array: ...

    def simulate(
        self,
        records: Record | Iterable[Record] | Array | Sequence[float],
        phase: str | None = None,
        sample_period: float | None = None,
    ) -> list[Array] | Array:
        """Free-run displacement [m] of every record, each at its own sample period; or of a voltage from rest.

        A record starts at rest at its `settled_voltage`, unless it continues the one before it. Between the two, the
        last voltage is held. Over more than 0.1 s the dynamics settle, and only slow effects such as creep move on.

        Parameters
        ----------
        records : Record, iterable of Record, or (n,) array_like
            Give the whole experiment and `phase`, so that the state is carried into the records of that phase. An array
            is a drive voltage [V] of a stage settled at its first value.
        phase : str, optional
            Return only records whose phase name, or its first word, is `phase`, as `Experiment.named`.
        sample_period : float, optional
            Of an array [s], as in `rest`; records have their own.

        Returns
        -------
        list of (n,) ndarray, or (n,) ndarray for an array

        Raises
        ------
        ModelError
            If there is no such phase, or a record is faster than the model.

        Warns
        -----
        UnknownStateWarning
            If the first record continues one that is not given: it was simulated from rest, and is wrong at first.
        """
        return simulated(self, records, phase, sample_period)

    def standard_errors(self, records: Iterable[Record]) -> list[Array]:
        """Standard error (n,) [m] of the displacement of every record, from the covariance of the fitted numbers.

        The mean of each record is left out, because the sensor zero is free. A prediction band of 95 % is `simulate` ±
        1.96 of it, to first order, without the noise of the sensor and without effects that the model does not have.

        Raises
        ------
        ModelError
            If the model states no covariance.
        """
        return standard_errors(self, records)

    def free_run(self, records: Iterable[Record]) -> list[Array]:
        """As `simulate`, without the warning about the start of the first record."""
        return free_run(self, records)

    def linearise(
        self, records: Iterable[Record], wanted: Collection[str], block: int = 8192
    ) -> Iterator[tuple[int, slice, Array, tuple[str, ...], Array]]:
        """Free run with sensitivities, block by block, so that records of any length fit in memory.

        Yields
        ------
        index : int
            Of the record.
        part : slice
            Samples of the record in this block.
        y : (k,) ndarray
            Displacement [m].
        names : tuple of str
            The numbers `wanted`, in chain order.
        slopes : (q, k) ndarray
            ∂y/∂θ of each of them.
        """
        return linearised_run(self, records, frozenset(wanted), block)

    def sensitivities(self, record: Record, wanted: Collection[str]) -> tuple[Array, dict[str, Array]]:
        """Free-run displacement (n,) of a record from rest, and ∂y/∂θ (n,) of every number `wanted` of the model."""
        for name in wanted:
            self.row(name)
        ((_, _, y, names, slopes),) = self.linearise([record], wanted, block=record.size)
        return y, dict(zip(names, slopes, strict=True))
