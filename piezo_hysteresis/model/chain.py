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

"""`Chain`: a model's coefficients at one sample period, ready to run.

The blocks of the effects in the order of physics, with the two changes of unit (volts to v, position to metres) between
them. Everything is composed over blocks of samples; only kernels loop.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Block, State, SumBlock
from ..blocks.channel_addition import ChannelBlock
from ..blocks.scaling import ChangeOfUnit, hand_out, take_in
from ..effects import ChainPosition, Discretisation, Effect
from ..errors import DivergenceError, ModelError
from .samples import not_finite

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

RUNAWAY = 1e9
"""Displacement, in displacement scales, beyond which a simulation counts as diverged."""

BLOCK = 32768
"""Number of samples that are processed together by the whole chain, so that they stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class ChainState:
    """State of a chain between two blocks of samples."""

    blocks: tuple[State, ...]
    inputs: tuple[float, ...]
    """Last input of every block."""
    time: float
    """Time of the next sample [s]."""
    sample_period: float
    """Sample period of the chain [s]."""
    effects: tuple[str, ...]
    """Names of the effects of the chain."""


@dataclass(frozen=True, slots=True)
class ChainTangent:
    """State of the sensitivities between two blocks of samples."""

    blocks: tuple[State, ...]
    inputs: tuple[Array, ...]


class Chain:
    """Blocks from drive voltage to displacement at one sample period.

    Parameters
    ----------
    effects : tuple of Effect
        In chain order.
    setting : Discretisation
        Sample periods and scales.
    """

    def __init__(self, effects: tuple[Effect, ...], setting: Discretisation) -> None:
        self.setting, self.effects = setting, tuple(e.name for e in effects)
        hosted: dict[str, tuple[Effect, ...]] = {
            e.name: tuple(t for t in effects if t.host == e.name) for e in effects if e.host is None
        }

        def blocks(place: ChainPosition) -> list[tuple[str, Block]]:
            here = [e for e in effects if e.place is place and e.host is None]
            return [(e.name, e.block(setting, hosted[e.name])) for e in here]

        hysteresis = blocks(ChainPosition.HYSTERESIS)
        if len(hysteresis) > 1:
            hysteresis = [(hysteresis[0][0], SumBlock(*zip(*((b, n) for n, b in hysteresis), strict=True)))]
        parts = [
            *blocks(ChainPosition.DRIVE),
            ("voltage_scale", ChangeOfUnit(1.0 / setting.voltage_scale)),
            *hysteresis,
            *blocks(ChainPosition.MATERIAL),
            *blocks(ChainPosition.DYNAMICS),
            *blocks(ChainPosition.SENSOR),
            ("displacement_scale", ChangeOfUnit(setting.displacement_scale)),
            *blocks(ChainPosition.ENVIRONMENT),
        ]
        self.labels = tuple(label for label, _ in parts)
        self.blocks = tuple(block for _, block in parts)
        self.channels = frozenset(b.channel for b in self.blocks if isinstance(b, ChannelBlock))
        """Names of the extra channels that are used."""
        first, last = self.blocks[0], self.blocks[-1]
        # the changes of unit at both ends are done with the input and output checks
        self._factor_in, begin = (first.factor, 1) if isinstance(first, ChangeOfUnit) else (1.0, 0)
        self._factor_out, end = (last.factor, -1) if isinstance(last, ChangeOfUnit) else (1.0, None)
        self._inner = range(len(self.blocks))[begin:end]

    def rest(self, voltage: float, time: float = 0.0, since: float | None = None) -> ChainState:
        """State of a stage settled at `voltage` [V].

        Parameters
        ----------
        voltage : float
            Drive voltage [V]; ModelError if it is not finite.
        time : float
            Of the first sample [s].
        since : float, optional
            Time since which the stage has been settled [s]; default `time`.
        """
        if not np.isfinite(voltage):
            raise ModelError(f"rest: got {voltage:g} V, expected a finite voltage")
        states, inputs, x = [], [], float(voltage)
        for block in self.blocks:
            state = block.rest(x, time if since is None else since)
            states.append(state if since is None else block.resume(x, state, time))
            inputs.append(x)
            x = block.static_at(x, time)
        return ChainState(tuple(states), tuple(inputs), time, self.setting.sample_period, self.effects)

    def require_own(self, state: ChainState) -> None:
        """Raise ModelError for the state of a chain of other effects."""
        if state.effects != self.effects:
            got, expected = (" → ".join(effects) or "no effects" for effects in (state.effects, self.effects))
            raise ModelError(f"state: got one of another model ({got}), expected one of {expected}")

    def rest_tangent(self, voltage: float, wanted: Collection[str], time: float = 0.0) -> ChainTangent:
        """Tangent state of `rest` for the parameters `wanted`."""
        states, inputs, x, dx = [], [], float(voltage), np.empty(0)
        for block in self.blocks:
            states.append(block.rest_tangent(x, dx))
            inputs.append(dx)
            slope, own = block.static_slopes_at(x, time)
            dx = np.concatenate((slope * dx, own[[n in wanted for n in block.names]] if block.names else own))
            x = block.static_at(x, time)
        return ChainTangent(tuple(states), tuple(inputs))

    def resume(self, state: ChainState) -> ChainState:
        """Continue from a chain at another sample period: memories and clocks continue, filters start settled."""
        states = tuple(
            block.resume(x, s, state.time) for block, s, x in zip(self.blocks, state.blocks, state.inputs, strict=True)
        )
        return ChainState(states, state.inputs, state.time, self.setting.sample_period, self.effects)

    def resume_tangent(self, state: ChainState, tangent: ChainTangent) -> ChainTangent:
        """`resume` for the tangent state."""
        states = tuple(
            t if block.keeps_state else block.rest_tangent(x, dx)
            for block, t, x, dx in zip(self.blocks, tangent.blocks, state.inputs, tangent.inputs, strict=True)
        )
        return ChainTangent(states, tangent.inputs)

    def run(self, u: Array, state: ChainState, channels: Channels | None = None) -> tuple[Array, ChainState]:
        """Displacement of the next samples.

        Parameters
        ----------
        u : (n,) ndarray
            Drive voltage [V], float64.
        state : ChainState
            From `rest` or the block before.
        channels : mapping of str to (n,) ndarray, optional
            ``other_displacement`` [m], ``temperature`` [K].

        Raises
        ------
        ModelError
            On samples that are not finite.
        DivergenceError
            With effect, sample and time of the first divergence.
        """
        y = np.empty(u.size)
        copy = not (u.flags.c_contiguous and u.flags.writeable)  # another array type would compile the kernels again
        for start in range(0, u.size, BLOCK):
            part = slice(start, start + BLOCK)
            here = u[part].copy() if copy else u[part]
            state = self._run(here, state, self.channels_in(channels, part), start, y[part])
        return y, state

    def channels_in(self, channels: Channels | None, part: slice) -> Channels:
        """Copies of the channels that are used, for some of the samples."""
        return {name: c[part].copy() for name, c in (channels or {}).items() if name in self.channels}

    def _run(self, u: Array, state: ChainState, channels: Channels, first: int, y: Array) -> ChainState:
        states, inputs = list(state.blocks), [float(u[-1])] * len(self.blocks)
        x = np.empty(u.size) if self._inner else y
        if not take_in(u, self._factor_in, x):
            raise not_finite("voltage", u, first)
        for k in self._inner:
            block, inputs[k] = self.blocks[k], float(x[-1])
            s = channels.get(block.channel) if isinstance(block, ChannelBlock) else states[k]
            if k < self._inner[-1]:
                x, states[k] = block.run(x, s)
            else:
                states[k] = block.run_into(x, s, y)
        if self._inner.stop < len(self.blocks):
            inputs[-1] = float(y[-1])
        if not hand_out(y, self._factor_out, RUNAWAY * self.setting.displacement_scale):
            self._report_divergence(u, state, channels, first)
        time = state.time + u.size * self.setting.sample_period
        return ChainState(tuple(states), tuple(inputs), time, self.setting.sample_period, self.effects)

    def _report_divergence(self, u: Array, state: ChainState, channels: Channels, first: int) -> None:
        x = u
        for label, block, s in zip(self.labels, self.blocks, state.blocks, strict=True):
            if isinstance(block, ChannelBlock):
                s = channels.get(block.channel)
            x, _ = block.run(x, s)
            bad = ~(np.abs(x) < RUNAWAY)
            if bad.any():
                sample = int(bad.argmax())
                raise DivergenceError(label, first + sample, state.time + sample * self.setting.sample_period)
        last = u.size - 1
        raise DivergenceError(self.labels[-1], first + last, state.time + last * self.setting.sample_period)

    def linearise(
        self,
        u: Array,
        state: ChainState,
        tangent: ChainTangent,
        wanted: Collection[str],
        channels: Channels | None = None,
    ) -> tuple[Array, tuple[str, ...], Array, ChainState, ChainTangent]:
        """`run`, and in the same pass the names of the parameters `wanted`, in chain order, and their ∂y/∂θ (q, n)."""
        if not wanted:
            y, state = self.run(u, state, channels)
            return y, (), np.empty((0, u.size)), state, tangent
        states, tangents, inputs, dinputs = [], [], [], []
        room = np.empty((sum(len(block.names) for block in self.blocks), u.size))
        x, dx, rows = u, room[:0], []
        for block, s, t in zip(self.blocks, state.blocks, tangent.blocks, strict=True):
            inputs.append(float(x[-1]))
            dinputs.append(dx[:, -1].copy())
            if isinstance(block, ChannelBlock):
                s = (channels or {}).get(block.channel)
            before = len(dx)
            x, dx, s, t = block.linearise(x, dx, s, t)
            if dx.base is not room:
                room[: len(dx)] = dx
            kept = [k for k, n in enumerate(block.names) if n in wanted]
            for j, k in enumerate(kept):
                if j < k:
                    room[before + j] = room[before + k]
            dx = room[: before + len(kept)]
            rows += [block.names[k] for k in kept]
            states.append(s)
            tangents.append(t)
        time = state.time + u.size * self.setting.sample_period
        state = ChainState(tuple(states), tuple(inputs), time, self.setting.sample_period, self.effects)
        return x, tuple(rows), dx, state, ChainTangent(tuple(tangents), tuple(dinputs))
