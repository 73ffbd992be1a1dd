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

"""Inverse of linear dynamics: of one section, as an FIR filter with preview and a recursion, and of a whole block."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...c_form import CForm
from ...errors import ModelError
from ..arx import arx_row, difference_equation, padded
from ..block import Block, Section, State
from .factors import factors, preview_taps, zero_phase_taps
from .inverted_block import InvertedBlock

Array = NDArray[np.float64]


class LinearInverse:
    """Computes x from y = H x, `preview` samples later.

    Zeros inside the unit circle become poles of a recursion, which is exact. Zeros outside and the delay need future
    samples: 1/(1 − z0 z⁻¹) = −Σ_(k ≥ 1) (z/z0)^k. Zeros at the unit circle are inverted by zero-phase tracking, which
    is approximate.

    Parameters
    ----------
    section : tuple of ndarray
        Numerator and denominator of H in powers of z⁻¹.
    gain : float
        Value of H(1) that the block uses at rest.
    name : str
        Name of the effect, for messages.

    Attributes
    ----------
    preview : int
        Number of future samples of y that must be known.
    is_exact : bool
        False if a zero lies at the unit circle.
    noise_gain : float
        Σ |impulse response|: the largest factor by which rounding errors and noise of y grow.

    Raises
    ------
    ModelError
        If H(1) = 0, so that no constant input gives a constant output.
    """

    def __init__(self, section: Section, gain: float, name: str) -> None:
        numerator, denominator = section
        if gain == 0.0 or not np.any(numerator):
            raise ModelError(f"{name}: its gain at dc is 0, so no voltage holds a displacement; expected a gain")
        parts = factors(numerator)
        ahead, taps = preview_taps(parts.outside)
        near, zero_phase = zero_phase_taps(parts.near)
        self.preview, self.is_exact, self.gain = parts.delay + ahead + near, parts.near.size == 1, gain
        self._taps = np.convolve(np.convolve(taps, zero_phase), denominator) / parts.inside[0]
        self._feedback = parts.inside[1:] / parts.inside[0]
        self._section = section
        self._padded, self._recursion = padded(self._taps), padded(self._feedback)
        self.noise_gain = float(np.abs(self.impulse_response()).sum())

    def impulse_response(self, size: int = 20000) -> Array:
        """Impulse response of the inverse, delayed by `preview` samples, shape (size,)."""
        impulse, out = np.eye(1, size)[0], np.empty(size)
        arx_row(impulse, 0.0, 0.0, self._padded, 0, self._recursion, self._zeros(), out)
        return out

    def error(self, frequency: Array, sample_period: float) -> Array:
        """|H · inverse − 1| at frequencies [Hz], shape (k,)."""
        z = np.exp(-2j * np.pi * np.asarray(frequency) * sample_period)
        forward = np.polyval(self._section[0][::-1], z) / np.polyval(self._section[1][::-1], z)
        inverse = np.polyval(self._taps[::-1], z) / np.polyval(np.append(1.0, self._feedback)[::-1], z)
        return np.asarray(np.abs(forward * inverse / z**self.preview - 1.0))

    def _zeros(self) -> Array:
        return np.zeros(self._padded.size - 1 + self._recursion.size)

    def rest(self, x0: float) -> tuple[float, Array]:
        """State after a long time at the input x0."""
        return x0, self._zeros()

    def c_form(self) -> CForm:
        """The filter as C code: its ``rest`` takes x at rest and returns it."""
        rest = "s->x_rest = gain * x;\ns->y_rest = x;\nreturn x;"
        return difference_equation(self._taps, 0, self._feedback, rest, gain=float(self.gain))

    def run(self, y: Array, state: tuple[float, Array]) -> tuple[Array, tuple[float, Array]]:
        """Next samples: x (n,) for the y (n,) of `preview` samples before, and the state after them."""
        x0, z = state[0], state[1].copy()
        x = np.empty_like(y)
        arx_row(y, self.gain * x0, x0, self._padded, 0, self._recursion, z, x)
        return x, (x0, z)


class InvertedLinear(InvertedBlock):
    """Inverse of sections of linear dynamics in series.

    A block that still moves at the start, after an earlier drive, would move on by itself if its input were held. The
    inputs add to this motion, because the block is linear, so it is subtracted from the wanted output. A block in which
    an effect was left out starts settled, because its states are not those of the model (`continues` is false).
    """

    def __init__(self, block: Block, sections: Iterable[Section], name: str, continues: bool) -> None:
        self._block, self._continues = block, continues
        slope, _ = block.static_slopes(0.0)
        own = list(sections)
        gains = [slope] if len(own) == 1 else [float(b.sum() / a.sum()) for b, a in own]
        self.inverses = [LinearInverse(s, g, name) for s, g in zip(own, gains, strict=True)][::-1]
        self.preview = sum(i.preview for i in self.inverses)
        self.is_exact = all(i.is_exact for i in self.inverses)
        self.noise_gain = float(np.prod([i.noise_gain for i in self.inverses]))

    def start(self, x0: float, state: State, ahead: int) -> State:
        moving = None
        if self._continues and (state[0] != x0 or state[1].any()):
            held = np.full(self.preview + ahead, x0)
            moving = x0, self._block.run(held, state)[1] if held.size else state
        states = []
        for inverse in self.inverses[::-1]:
            states.append(inverse.rest(x0))
            x0 = inverse.gain * x0
        return tuple(states[::-1]), moving

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        own, moving = state
        if moving is not None:
            x0, before = moving
            free, after = self._block.run(np.full(y.size, x0), before)
            y, moving = y - (free - self._block.static(x0)), (x0, after)
        states = []
        for inverse, s in zip(self.inverses, own, strict=True):
            y, s = inverse.run(y, s)
            states.append(s)
        return y, (tuple(states), moving)

    def c_form(self, ahead: int) -> CForm:
        parts = {f"section_{k}": inverse.c_form() for k, inverse in enumerate(self.inverses)}
        steps = [f"x = {part.call('step', name, 'x')};" for name, part in parts.items()]
        rest = [f"{part.call('rest', n, 'x')};\nx = gain_{k} * x;" for k, (n, part) in enumerate(parts.items())][::-1]
        gains = {f"gain_{k}": float(inverse.gain) for k, inverse in enumerate(self.inverses)}
        return CForm("\n".join((*steps, "return x;")), "\n".join((*rest, "return x;")), gains, parts=parts)
