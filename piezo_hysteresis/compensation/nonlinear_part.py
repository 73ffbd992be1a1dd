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

"""`NonlinearPart`: creep, hysteresis, amplifier and limits of a chain, which are inverted together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Block, State, SumBlock
from ..blocks.low_pass import LowPassBlock
from ..blocks.relaxation import RelaxationBlock
from ..blocks.scaling import ChangeOfUnit
from ..c_form import CForm, Number
from ..effects.drive.amplifier_saturation import RAMP, AmplifierSaturationBlock
from ..effects.drive.amplifier_slew_limit import AmplifierSlewLimitBlock
from ..effects.drive.backlash import BacklashBlock
from ..effects.hysteresis.bouc_wen import BoucWenBlock
from ..effects.hysteresis.even_input_polynomial import EvenInputPolynomialBlock
from ..effects.hysteresis.hysteresis_memory import HysteresisMemoryBlock
from ..effects.hysteresis.level_dependent_memory import LevelDependentMemoryBlock
from ..effects.hysteresis.published_bouc_wen import PublishedBlock
from ..effects.material.creep_exponential import CreepExponentialBlock
from ..errors import ModelError
from . import hysteresis_solver as solver
from . import recursion as r
from .limits import Limits

Array = NDArray[np.float64]

RecursionState = tuple[Array, Array, Array, Array]
"""State of drive and loop, of the plays, last inputs of the relaxations, and state of the relaxations."""

KINDS = (
    AmplifierSaturationBlock,
    AmplifierSlewLimitBlock,
    BacklashBlock,
    ChangeOfUnit,
    BoucWenBlock,
    PublishedBlock,
    HysteresisMemoryBlock,
    LevelDependentMemoryBlock,
    EvenInputPolynomialBlock,
    RelaxationBlock,
    CreepExponentialBlock,
    SumBlock,
)
"""Blocks that the recursion can invert, in addition to a low-pass before the hysteresis."""

LOOPS = (BoucWenBlock, PublishedBlock, HysteresisMemoryBlock, LevelDependentMemoryBlock)
"""Blocks with a static part of their own."""

FARTHEST = 1e3
"""Largest normalised drive in which a root is searched."""


class NonlinearPart:
    """The first blocks of a chain, which are inverted together.

    Parameters
    ----------
    blocks : sequence of Block
        Blocks from the drive to the creep; sums are split into their members.
    limits : Limits
        Of the drive.
    sample_period : float
        [s]

    Raises
    ------
    ModelError
        If the hysteresis has no static slope.
    """

    def __init__(self, blocks: Sequence[Block], limits: Limits, sample_period: float) -> None:
        self.blocks = [m for b in blocks for m in (b.members if isinstance(b, SumBlock) else (b,))]
        self.kind, self.loop, self.periods = solver.NO_LOOP, np.zeros(8), np.full(2, sample_period)
        self.poly, self.weights, self.radii = np.zeros(4), np.zeros((2, 0)), np.zeros(0)
        self.drive = np.zeros(16)
        self.drive[[r.PER_VOLT, r.LEAD]] = 1.0
        self.drive[[r.LOWER, r.UPPER, r.REACH]] = -np.inf, np.inf, np.inf
        self.drive[[r.LOWEST, r.HIGHEST]] = limits.voltage_min, limits.voltage_max
        self.drive[[r.STEP, r.RESOLUTION]] = limits.max_slew_rate * sample_period, limits.resolution
        banks: list[tuple[float, Array, Array, Array]] = []
        for block in self.blocks:
            self._take(block, banks)
        if not any(isinstance(b, LOOPS) for b in self.blocks):
            self.poly[solver.P2] += 1.0 if not any(isinstance(b, EvenInputPolynomialBlock) for b in self.blocks) else 0
        self._bracket()
        self.bank = self._bank(banks)

    def _take(self, block: Block, banks: list[tuple[float, Array, Array, Array]]) -> None:
        d = self.drive
        if isinstance(block, AmplifierSaturationBlock):
            d[[r.LOWER, r.UPPER, r.CORNER]] = block.lower, block.upper, block.corner
        elif isinstance(block, AmplifierSlewLimitBlock):
            d[r.REACH] = block.reach
        elif isinstance(block, LowPassBlock):
            d[[r.LEFT, r.LEAD, r.BACK]] = block.step
        elif isinstance(block, BacklashBlock):
            d[r.PLAY] = block.b
        elif isinstance(block, ChangeOfUnit):
            d[r.PER_VOLT] = block.factor
        elif isinstance(block, BoucWenBlock):
            self.kind = solver.PLAIN if block.is_plain else solver.GENERAL
            self.loop, self.periods = block.loop, np.array([block.sample_period, block.jump_period])
            self.poly[[solver.P1, solver.P2]] = block.p1, block.p2
        elif isinstance(block, PublishedBlock):
            self.kind, self.loop = solver.PUBLISHED, np.append(block.p[:4], np.zeros(4))
            self.poly[[solver.P1, solver.P2]] = block.p[4:]
        elif isinstance(block, HysteresisMemoryBlock):
            self.weights, self.radii = np.vstack((block.c, np.zeros(block.c.size))), block.radii
        elif isinstance(block, LevelDependentMemoryBlock):
            self.weights, self.radii = np.vstack((block.c, block.bends)), block.radii
        elif isinstance(block, EvenInputPolynomialBlock):
            self.poly[[solver.SQUARE, solver.FOURTH]] = block.p_e, block.p_4
        elif isinstance(block, RelaxationBlock):
            banks.append((float(block.mix[0]), block.hold.fade, block.hold.lead, block.mix[1:]))
        elif isinstance(block, CreepExponentialBlock):
            steps = np.array([pole.step for pole in block.poles]).reshape(-1, 3)
            banks.append((0.0, 1.0 - steps[:, 0], steps[:, 1], block.c))
        else:
            raise ModelError(f"{type(block).__name__}: has no inverse; expected a block that compensation can invert")

    def _bracket(self) -> None:
        """Set the interval in which roots are searched: between extrema of the static curve, inside the limits."""
        p1, p2, square, fourth = self.poly
        c, bends = self.weights
        slope = np.array([p2 + c.sum(), 2.0 * (square + c @ bends), 3.0 * p1, 4.0 * fourth])
        if slope[0] == 0.0:
            raise ModelError("hysteresis: the static curve has no slope at 0 V; expected p2 or plays")
        d = self.drive
        d[r.TURN] = np.sign(slope[0])
        roots = np.roots(slope[::-1])
        real = roots[np.abs(roots.imag) < 1e-9].real
        ends = [r.saturated(u, d[r.LOWER], d[r.UPPER], d[r.CORNER]) for u in (d[r.LOWEST], d[r.HIGHEST])]
        d[r.LOW] = max(-FARTHEST, ends[0] * d[r.PER_VOLT], *real[real < 0.0])
        d[r.HIGH] = min(FARTHEST, ends[1] * d[r.PER_VOLT], *real[real > 0.0])

    @staticmethod
    def _bank(
        banks: list[tuple[float, Array, Array, Array]],
    ) -> tuple[NDArray[Any], ...]:
        starts = np.cumsum([0, *(b[1].size for b in banks)]).astype(np.uint64)
        direct = np.array([b[0] for b in banks])
        fade, lead, weights = (np.concatenate([np.zeros(0), *(b[k] for b in banks)]) for k in (1, 2, 3))
        gains = np.array([1.0 + b[0] + float(b[3] @ b[2]) for b in banks])
        return starts, direct, fade, lead, weights, gains

    def start(self, inputs: Sequence[float], states: Sequence[State]) -> RecursionState:
        """State of the recursion from the last inputs and states of the blocks; sums are split into their members."""
        state, plays, lasts = np.zeros(8), np.zeros(self.radii.size), []
        banks: list[Array] = [np.zeros(0)]
        at = float(inputs[0])
        state[: r.PUSHED + 1] = at
        for block, x, own in zip(self.blocks, inputs, states, strict=True):
            if isinstance(block, AmplifierSaturationBlock):
                state[r.SLEWED : r.PUSHED + 1] = block.static(x)
            elif isinstance(block, AmplifierSlewLimitBlock):
                state[r.SLEWED : r.PUSHED + 1] = own[0]
            elif isinstance(block, LowPassBlock):
                x0, z = own
                state[r.SLEWED], state[r.POLE : r.PUSHED + 1] = x0 + z[0, 0], x0 + z[0, 1]
            elif isinstance(block, BacklashBlock):
                state[r.HELD] = own[0]
            elif isinstance(block, BoucWenBlock | PublishedBlock):
                state[r.H] = own[0]
            elif isinstance(block, HysteresisMemoryBlock | LevelDependentMemoryBlock):
                plays = own.copy()
            elif isinstance(block, RelaxationBlock):
                x0, z = own
                lasts.append(x0 + z[0, 0])
                banks.append(x0 + z[0, 1:])
            elif isinstance(block, CreepExponentialBlock):
                x0, z = own
                lasts.append(x)
                banks.append(x0 + z[0, 1::2])
        state[r.LAST] = state[r.HELD] * self.drive[r.PER_VOLT]
        hysteresis = self.kind, self.loop, self.periods, self.poly, self.weights, self.radii
        state[r.W] = solver.output(*hysteresis, state[r.H], state[r.LAST], plays, state[r.LAST])
        return state, plays, np.array(lasts), np.concatenate(banks)

    def c_form(self) -> CForm | str:
        """The recursion as C code: its ``rest`` takes the drive voltage, its ``step`` the wanted output."""
        loop: CForm | str = CForm("")
        numbers: dict[str, Number] = {"h0": 0.0, "virgin": 0.0, "PLAYS": self.radii.size}
        settled = []
        for block in self.blocks:
            if isinstance(block, BoucWenBlock | PublishedBlock):
                loop = block.c_form()
                numbers["h0"] = block.static(0.0)
            elif isinstance(block, HysteresisMemoryBlock | LevelDependentMemoryBlock):
                numbers["virgin"] = block.virgin
            elif isinstance(block, RelaxationBlock | CreepExponentialBlock):
                settled.append(block.gain)
        if isinstance(loop, str):
            return loop
        one_at_least = (0, max(0, 1 - self.radii.size))  # C has no empty arrays
        plays = (("c", self.weights[0]), ("bend", self.weights[1]), ("radius", self.radii))
        numbers |= {name: np.pad(values, one_at_least) for name, values in plays}
        numbers |= {"loop": np.append(self.loop, self.periods), "poly": self.poly}
        numbers |= dict(zip(r.NAMES_IN_C, self.drive.tolist(), strict=True))
        state = ["double voltage, slewed, pole, held, pushed", "double h, v, w"]
        state.append(f"double play[{max(1, self.radii.size)}]")
        before: list[str] = []
        rest, after = [r.REST_IN_C], []
        starts, direct, *rows, gains = self.bank
        for b, (gain, whole) in enumerate(zip(gains, settled, strict=True)):
            fade, lead, weight = (row[starts[b] : starts[b + 1]] for row in rows)
            bank: dict[str, Number] = {
                "SIZE": fade.size,
                "fade": fade,
                "lead": lead,
                "weight": weight,
                "direct": float(direct[b]),
            }
            numbers |= {f"{name}_{b}": value for name, value in (bank | {"gain": gain, "settled": whole}).items()}
            state += [f"double last_{b}, bank_{b}[{fade.size}]"]
            before.insert(0, r.BEFORE_IN_C.replace("BANK", str(b)))
            rest.append(r.SETTLED_IN_C.replace("BANK", str(b)))
            after.append(r.AFTER_IN_C.replace("BANK", str(b)))
        library = (*loop.library, RAMP, solver.LOOP_END_IN_C[self.kind], solver.SOLVE_IN_C, r.AMPLIFIER_IN_C)
        step = "".join((*before, r.DRIVE_IN_C, *after, "return u;"))
        return CForm(step, "".join((*rest, "return w;")), numbers, tuple(state), library)

    def run(self, targets: Array, state: RecursionState) -> tuple[Array, RecursionState]:
        """Drive (n,) [V] for wanted outputs of the material (n,), and the state after it."""
        own, plays, lasts, banks = (part.copy() for part in state)
        u = np.empty_like(targets)
        hysteresis = self.kind, self.loop, self.periods, self.poly, self.weights, self.radii
        r.invert(targets, *hysteresis, self.drive, self.bank, own, plays, lasts, banks, u)
        return u, (own, plays, lasts, banks)
