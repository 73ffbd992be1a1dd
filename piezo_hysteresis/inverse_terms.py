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

"""`InverseTerms`: terms of a block in the inverse of drive, hysteresis and creep, declared next to its kernel.

These blocks are inverted together, in one recursion (`piezo_hysteresis.compensation`), for a drive, a hysteresis

    w(v) = p1 v³ + p2 v + p_e v² + p_4 v⁴ + h(v) + Σ_j c_j (p_j + b_j p_j²)

with plays p_j, and relaxations of w in series. A block returns its parameters in these equations as `InverseTerms`, and
its state as `InverseStart`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NO_LOOP, PLAIN, GENERAL, PUBLISHED = range(4)
"""Kinds of loop: none, n = 1 without terms, with terms, the explicit step of Eq. (7)."""
POLYNOMIAL = ("p1", "p2", "p_e", "p_4")
"""Coefficients of the static polynomial in order: of v³, v, v² and v⁴."""


@dataclass(frozen=True, eq=False, slots=True)
class LoopTerms:
    """The loop h(v) of a hysteresis.

    Parameters
    ----------
    kind : int
        `PLAIN`, `GENERAL` or `PUBLISHED`.
    numbers : (8,) ndarray
        Parameters of its step.
    periods : tuple of float
        Sample period, and duration of a jump of the drive [s].
    initial : float
        h of a stage at rest.
    library : tuple of str
        C functions of its step.
    """

    kind: int
    numbers: Array
    periods: tuple[float, float] | None = None
    initial: float = 0.0
    library: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class PlayTerms:
    """Plays of a hysteresis.

    Parameters
    ----------
    weights, radii : (s,) ndarray
        c_j, and half widths in units of v.
    virgin : float
        State at rest: 0 for centred plays, 1 for the state after the drive before the rest.
    before : (s,) ndarray or None
        Plays before the drive came to the rest; None for plays at 0.
    root : (3, s) ndarray or None
        a_j, b_j and q of the weights that depend on the level (`level_density`); None if they do not.
    """

    weights: Array
    radii: Array
    virgin: float = 0.0
    before: Array | None = None
    root: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class RelaxationTerms:
    """Relaxations x_j of the input w, added to it: w (1 + direct) + Σ_j weight_j x_j.

    Parameters
    ----------
    direct : float
        Share of w without delay.
    fade, lead, weights : (s,) ndarray
        Step of every relaxation, as in `blocks.relaxation.Hold`, and its weight.
    settled : float
        Share of w that is added at rest.
    """

    direct: float
    fade: Array
    lead: Array
    weights: Array
    settled: float


@dataclass(frozen=True, eq=False, slots=True)
class InverseTerms:
    """Parameters of a block in the recursion of the inverse; missing ones are not part of the block.

    Parameters
    ----------
    drive : mapping of str to float
        Numbers of the drive, by their names in `compensation.recursion.DRIVE`.
    polynomial : mapping of str to float
        Numbers of the static polynomial, by their names in `POLYNOMIAL`.
    loop : LoopTerms, optional
    plays : PlayTerms, optional
    relaxations : RelaxationTerms, optional
    """

    drive: Mapping[str, float] = field(default_factory=dict)
    polynomial: Mapping[str, float] = field(default_factory=dict)
    loop: LoopTerms | None = None
    plays: PlayTerms | None = None
    relaxations: RelaxationTerms | None = None

    @property
    def is_hysteresis(self) -> bool:
        """Whether the output of the block is w, or a summand of w."""
        return bool(self.polynomial) or self.loop is not None or self.plays is not None


@dataclass(frozen=True, eq=False, slots=True)
class InverseStart:
    """State of a block in the recursion of the inverse; missing parts are not part of the block.

    Parameters
    ----------
    drive : mapping of str to float
        States of the drive, by their names in `compensation.recursion.STATE`.
    h : float, optional
        State of the loop.
    plays : (s,) ndarray
        States of the plays.
    relaxations : tuple, optional
        Last input, and the states (s,) of the relaxations.
    """

    drive: Mapping[str, float] = field(default_factory=dict)
    h: float | None = None
    plays: Array = field(default_factory=lambda: np.zeros(0))
    relaxations: tuple[float, Array] | None = None


def summed(members: Sequence[InverseTerms | None]) -> InverseTerms | None:
    """Terms of the sum of parallel blocks; None if the recursion cannot represent the sum."""
    terms = [t for t in members if t is not None]
    loops, plays = [t.loop for t in terms if t.loop], [t.plays for t in terms if t.plays]
    if len(terms) < len(members) or not all(t.is_hysteresis for t in terms) or max(len(loops), len(plays)) > 1:
        return None
    names = {name for t in terms for name in t.polynomial}
    polynomial = {name: sum(t.polynomial.get(name, 0.0) for t in terms) for name in names}
    return InverseTerms(polynomial=polynomial, loop=loops[0] if loops else None, plays=plays[0] if plays else None)


def started_together(members: Sequence[InverseStart]) -> InverseStart:
    """State of parallel blocks."""
    h = [m.h for m in members if m.h is not None]
    return InverseStart(h=h[0] if h else None, plays=np.concatenate([m.plays for m in members]))
