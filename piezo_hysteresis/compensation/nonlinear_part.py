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

"""`NonlinearPart`: creep, hysteresis, amplifier and limits of a chain, which are inverted together.

Every block defines its terms in `Block.inverse_terms`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Block, State
from ..blocks.bouc_wen import bouc_wen_kernel as k
from ..c_form import CForm, Number
from ..effects.drive.amplifier_saturation import RAMP
from ..effects.hysteresis.level_density import DENSITY_IN_C, VALUE_IN_C
from ..errors import ModelError
from ..inverse_terms import GENERAL, NO_LOOP, POLYNOMIAL, InverseTerms, LoopTerms, PlayTerms, RelaxationTerms
from . import hysteresis_solver as solver
from . import hysteresis_solver_c as solver_c
from . import recursion as r
from .limits import Limits

Array = NDArray[np.float64]

RecursionState = tuple[Array, Array, Array, Array]
"""State of drive and loop (8,), state of the plays, last inputs of the relaxation banks, states of the relaxations."""

FARTHEST = 1e3
"""Largest normalised drive in which a root is searched."""
WITHOUT_LOOP = LoopTerms(NO_LOOP, np.zeros(8))
"""Loop of a chain without a loop."""


class NonlinearPart:
    """The first blocks of a chain, which are inverted together.

    Parameters
    ----------
    terms : sequence of InverseTerms
        Terms of the blocks from the drive to the creep.
    limits : Limits
        Limits of the drive.
    sample_period : float
        Sample period [s].

    Raises
    ------
    ModelError
        If the static curve of the hysteresis has no slope at 0 V.
    """

    def __init__(self, terms: Sequence[InverseTerms], limits: Limits, sample_period: float) -> None:
        drive = np.zeros(16)
        drive[[r.PER_VOLT, r.LEAD]] = 1.0
        drive[[r.LOWER, r.UPPER, r.REACH]] = -np.inf, np.inf, np.inf
        drive[[r.LOWEST, r.HIGHEST]] = limits.voltage_min, limits.voltage_max
        drive[[r.STEP, r.RESOLUTION]] = limits.max_slew_rate * sample_period, limits.resolution or 0.0
        for name, value in (item for t in terms for item in t.drive.items()):
            drive[r.DRIVE.index(name)] = value
        hysteresis = next((t for t in terms if t.is_hysteresis), InverseTerms(polynomial={"p2": 1.0}))
        self.poly = tuple(float(hysteresis.polynomial.get(name, 0.0)) for name in POLYNOMIAL)
        self._loop = hysteresis.loop or WITHOUT_LOOP
        self.kind, self.loop = self._loop.kind, tuple(self._loop.numbers.tolist())
        self.periods = self._loop.periods or (sample_period, sample_period)
        self._plays = hysteresis.plays or PlayTerms(np.zeros(0), np.zeros(0))
        c, self.radii = self._plays.weights, self._plays.radii
        self.weights = c[None] if self._plays.root is None else np.vstack((c, self._plays.root))
        self._bracket(drive)
        self.drive = tuple(drive.tolist())
        self._relaxations = [t.relaxations for t in terms if t.relaxations is not None]
        self.bank = self._bank(self._relaxations)

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest normalised drive of the search for roots."""
        return self.drive[r.LOW], self.drive[r.HIGH]

    @property
    def rises_at_every_speed(self) -> bool:
        """Whether w rises with the drive, or falls with it, at every speed inside the limits, also after it turns.

        Only a rate law is examined: a steep one has no root, or several, for steps of the drive above some speed.
        """
        p = self.loop
        if self.kind != GENERAL or p[k.RATE] == 0.0:
            return True
        fastest = min(self.drive[r.STEP] * self.drive[r.PER_VOLT], self.ends[1] - self.ends[0]) / self.periods[0]
        for speed in (k.SLOWEST, max(k.SLOWEST, fastest)):
            law = k.rate_factor(speed, p[k.RATE_EXPONENT])
            before = 1.0 + p[k.RATE] * law  # h turns with twice the slope
            now = before + p[k.RATE] * speed ** p[k.RATE_EXPONENT]
            if (self.poly[solver.P2] + p[k.A] * (before + now)) * self.drive[r.TURN] <= 0.0:
                return False
        return True

    def _bracket(self, d: Array) -> None:
        """Set in `d` the interval of the search for roots: between extrema of the static curve, inside the limits."""
        p1, p2, square, fourth = self.poly
        c, a, b, q = (*self.weights, 1.0, 0.0, 0.0)[:4]
        density = (a * a, 2.0 * a * b, b * b + 2.0 * a * q, 2.0 * b * q, q * q)
        slope = np.array([p2, 2.0 * square, 3.0 * p1, 4.0 * fourth, 0.0]) + [np.sum(c * d) for d in density]
        if slope[0] == 0.0:
            raise ModelError("hysteresis: the static curve has no slope at 0 V; expected p2 or plays")
        d[r.TURN] = np.sign(slope[0])
        roots = np.roots(slope[::-1])
        real = roots[np.abs(roots.imag) < 1e-9].real
        ends = [r.saturated(u, d[r.LOWER], d[r.UPPER], d[r.CORNER]) for u in (d[r.LOWEST], d[r.HIGHEST])]
        d[r.LOW] = max(-FARTHEST, ends[0] * d[r.PER_VOLT], *real[real < 0.0])
        d[r.HIGH] = min(FARTHEST, ends[1] * d[r.PER_VOLT], *real[real > 0.0])

    @staticmethod
    def _bank(relaxations: Sequence[RelaxationTerms]) -> tuple[NDArray[Any], ...]:
        starts = np.cumsum([0, *(b.weights.size for b in relaxations)]).astype(np.uint64)
        direct = np.array([b.direct for b in relaxations])
        rows = [(b.fade, b.lead, b.weights) for b in relaxations]
        fade, lead, weights = (np.concatenate([np.zeros(0), *(row[k] for row in rows)]) for k in range(3))
        gains = np.array([1.0 + b.direct + float(b.weights @ b.lead) for b in relaxations])
        return starts, direct, fade, lead, weights, gains

    def start(self, blocks: Sequence[Block], inputs: Sequence[float], states: Sequence[State]) -> RecursionState:
        """State of the recursion, from its blocks, their last inputs and their states."""
        state, plays, lasts = np.zeros(8), np.zeros(self.radii.size), []
        banks: list[Array] = [np.zeros(0)]
        state[: r.PUSHED + 1] = float(inputs[0])
        for block, x, own in zip(blocks, inputs, states, strict=True):
            begin = block.inverse_start(x, own)
            for name, value in begin.drive.items():
                state[r.STATE.index(name)] = value
            if begin.h is not None:
                state[r.H] = begin.h
            if begin.plays.size:
                plays = begin.plays.copy()
            if begin.relaxations is not None:
                lasts.append(begin.relaxations[0])
                banks.append(begin.relaxations[1])
        state[r.LAST] = state[r.HELD] * self.drive[r.PER_VOLT]
        hysteresis = self.kind, self.loop, self.periods, self.poly, self.weights, self.radii
        state[r.W] = solver.output(*hysteresis, state[r.H], state[r.LAST], plays, state[r.LAST])
        return state, plays, np.array(lasts), np.concatenate(banks)

    def c_form(self) -> CForm:
        """The recursion as C code: its ``rest`` takes the drive voltage, its ``step`` the wanted output."""
        numbers: dict[str, Number] = {
            "h0": self._loop.initial,
            "virgin": self._plays.virgin,
            "PLAYS": self.radii.size,
        }
        root = self.weights[1:].ravel()
        held = np.zeros_like(self.radii) if self._plays.before is None else self._plays.before
        plays = {"c": self.weights[0], "root": root, "radius": self.radii, "earlier": held}
        # C has no empty arrays
        numbers |= {name: values if values.size else np.zeros(1) for name, values in plays.items()}
        numbers |= {"loop": np.array(self.loop + self.periods), "poly": np.array(self.poly)}
        numbers |= dict(zip(r.DRIVE, self.drive, strict=True))
        state = ["double voltage, slewed, pole, held, pushed", "double h, v, w"]
        state.append(f"double play[{max(1, self.radii.size)}]")
        before: list[str] = []
        rest, after = [r.REST_IN_C], []
        for b, (gain, own) in enumerate(zip(self.bank[-1], self._relaxations, strict=True)):
            bank: dict[str, Number] = {
                "SIZE": own.fade.size,
                "fade": own.fade,
                "lead": own.lead,
                "weight": own.weights,
                "direct": own.direct,
            }
            numbers |= {f"{name}_{b}": value for name, value in (bank | {"gain": gain, "settled": own.settled}).items()}
            state += [f"double last_{b}, bank_{b}[{own.fade.size}]"]
            before.insert(0, r.BEFORE_IN_C.replace("BANK", str(b)))
            rest.append(r.SETTLED_IN_C.replace("BANK", str(b)))
            after.append(r.AFTER_IN_C.replace("BANK", str(b)))
        loop = (*self._loop.library, RAMP, solver_c.LOOP_END_IN_C[self.kind])
        play = (VALUE_IN_C, DENSITY_IN_C, solver_c.LEVEL_PLAYS_IN_C) if root.size else (solver_c.PLAYS_IN_C,)
        library = (*loop, *play, solver_c.SOLVE_IN_C, r.AMPLIFIER_IN_C)
        step = "".join((*before, r.DRIVE_IN_C, *after, "return u;"))
        return CForm(step, "".join((*rest, "return w;")), numbers, tuple(state), library)

    def run(self, targets: Array, state: RecursionState) -> tuple[Array, RecursionState]:
        """Drive (n,) [V] for wanted outputs of the creep (n,) [1], and the state after it."""
        own, plays, lasts, banks = (part.copy() for part in state)
        u = np.empty_like(targets)
        hysteresis = self.kind, self.loop, self.periods, self.poly, self.weights, self.radii
        r.invert(targets, *hysteresis, self.drive, self.bank, own, plays, lasts, banks, u)
        return u, (own, plays, lasts, banks)
