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

"""The modified Bouc-Wen operator: hysteresis of the published model, stepped exactly, and its asymmetric cubic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.bouc_wen.bouc_wen_kernel import (
    ADVANCE_IN_C,
    GENERAL_IN_C,
    LOOP,
    LOOP_OFF,
    PLAIN_IN_C,
    STEP_AT_SPEED_IN_C,
    run_general,
    run_plain,
)
from ...blocks.bouc_wen.bouc_wen_sensitivities import OWN, START, linearise_general, linearise_plain
from ...blocks.bouc_wen.speed_lag import FADE, LAGGED_STEP, LEFT, SHARE, run_lagged, speed_lag
from ...c_form import CForm, Number
from ...errors import ParameterError
from ...inverse_terms import GENERAL, PLAIN, InverseStart, InverseTerms, LoopTerms
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .initial_state import InitialState
from .operator import HysteresisOperator, Loop

MODIFIED_BOUC_WEN = (
    Parameter(
        "A",
        "A",
        "1",
        -0.7691,
        -1e3,
        1e3,
        "slope of the hysteresis state at a turning point",
        "paper, Eq. (2)",
        powers=(-1, 1),
    ),
    Parameter(
        "beta",
        "β",
        "1",
        4.6075,
        0.0,
        1e4,
        "loss rate of the hysteresis state",
        "paper, Eq. (2)",
        scale=5.0,
        powers=(-1, 0),
    ),
    Parameter(
        "gamma", "γ", "1", -0.8725, -1e4, 1e4, "asymmetry of the loss rate; |γ| ≤ β", "paper, Eq. (2)", powers=(-1, 0)
    ),
    Parameter(
        "p1", "p1", "1", -0.1085, -1e3, 1e3, "cubic term; 0 gives CBW", "paper, Eq. (3)", scale=0.1, powers=(-3, 1)
    ),
    Parameter(
        "p2",
        "p2",
        "1",
        2.1925,
        -1e3,
        1e3,
        "proportional term of the output",
        "paper, Eq. (3)",
        scale=2.0,
        powers=(-1, 1),
    ),
)
"""Parameters of the modified Bouc-Wen operator."""


def check_bounded(effect: Effect) -> None:
    """Refuse β < |γ|, for which the state is unbounded (Ismail et al. 2009)."""
    if abs(effect["gamma"]) > effect["beta"] * (1 + 1e-12):
        raise ParameterError(
            f"{effect.name}: got beta = {effect['beta']:g}, gamma = {effect['gamma']:g}, expected beta >= |gamma|"
        )


class ModifiedBoucWen(HysteresisOperator):
    """Base class of both forms of the modified Bouc-Wen operator: checks and start values that they share."""

    gain_names = ("A", "p1", "p2")
    memory_names = ("A", "beta", "gamma")
    loop_names = ("A",)

    def check(self) -> None:
        check_bounded(self)

    @property
    def has_memory(self) -> bool:
        return self["A"] != 0.0

    @property
    def turning_slope(self) -> float:
        return self["p2"] + self["A"]

    def started(self, loops: Sequence[Loop]) -> Self:
        from .bouc_wen_start import closest_loop  # imports scipy.optimize, which would delay the start of nodes

        # a drive with two levels hardly determines the loop, whose height can then be any number
        found, rows = closest_loop(loops).items(), {p.name: p for p in self.parameters}
        return self.with_values(**{n: min(max(v, rows[n].lower), rows[n].upper) for n, v in found})


class BoucWen(ModifiedBoucWen):
    """Modified Bouc-Wen operator with the exact step for n = 1.

    Parameters
    ----------
    A, beta, gamma : float
        Loop of Eq. (2), dimensionless; beta >= |gamma|.
    p1, p2 : float
        Polynomial of Eq. (3), dimensionless.

    Notes
    -----
    The drive is taken as linear between samples, so the result does not depend on the sample rate, unlike Eq. (7).
    Asymmetry, exponent, rate dependence and initial state are terms of this loop.

    Examples
    --------
    At the same voltage, the rising and the falling branch differ:

    >>> import numpy as np
    >>> block = BoucWen().block(Discretisation(1e-3, 1e-3))
    >>> w, state = block.run(np.array([0.1, 0.2, 0.3, 0.2, 0.1]), block.rest(0.0, 0.0))
    >>> bool(w[4] > w[0])
    True
    """

    name = "bouc_wen"
    invertibility = Invertibility.EXACT
    equation = "w = p1 v³ + p2 v + h;  dh = A dv − β|dv|h − γ dv|h|"
    signature = "The loops do not depend on rate. They have one memory state, which saturates at |A|/(β + γ sgn A)"
    source = "paper, Eq. (2), (3), (6); exact step for n = 1"
    parameters = MODIFIED_BOUC_WEN
    start_term = InitialState

    def memoryless(self) -> Self:
        return type(self)(A=0.0, gamma=0.0, p1=self["p1"], p2=self["p2"])

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return BoucWenBlock(self, setting, terms)


PLAIN_STEP, GENERAL_STEP = (
    f"const double dv = x - s->v;\nif (dv != 0.0) {{\n    s->v = x;\n    s->h = {call};\n}}\n"
    "return p1 * x * x * x + p2 * x + s->h;"
    for call in ("plain_step(s->h, dv, A, beta, gamma)", "general_step(s->h, dv, loop, period, jump_period)")
)
"""C code of one sample of the loop, plain and with terms."""


class BoucWenBlock(Block):
    """The loop with its terms; state [h, v_last, q] with the lagged speed q, which is 0 without a lag."""

    keeps_state = True

    def __init__(self, effect: Effect, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> None:
        self.sample_period, self.jump_period = setting.sample_period, setting.model_period
        self.p1, self.p2 = effect["p1"], effect["p2"]
        self.loop = LOOP_OFF.copy()
        self.start = self.tau = 0.0
        owners = dict.fromkeys(("A", "beta", "gamma"), effect.name)
        for term in terms:
            owners |= {name: term.name for name in term.values if name in OWN}
        for member in (effect, *terms):
            for name in member.values:
                if name in LOOP:
                    self.loop[LOOP.index(name)] = member[name]
                elif name == "h0":
                    self.start = member[name]
                elif name == "tau":
                    self.tau = member[name]
                elif name == "jumps" and not member[name]:
                    self.jump_period = setting.sample_period
        self.own = np.array([OWN.index(n) for n in owners], dtype=np.int64)
        self.lag = speed_lag(self.tau, self.sample_period, self.jump_period)
        self.names = (*(f"{owner}.{n}" for n, owner in owners.items()), f"{effect.name}.p1", f"{effect.name}.p2")
        self.is_plain = bool(np.array_equal(self.loop[3:7], LOOP_OFF[3:7]))

    def static(self, x0: float) -> float:
        return self.p1 * x0 * x0 * x0 + self.p2 * x0 + self.start

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 3.0 * self.p1 * x0 * x0 + self.p2, np.append(self.own == START, [x0**3, x0])

    def rest(self, x0: float, time: float) -> State:
        return np.array([self.start, x0, 0.0])

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        w, state = np.empty_like(x), state.copy()
        chosen = self.loop, self.p1, self.p2
        if self.is_plain:
            run_plain(x, *chosen, state, w)
        elif self.tau:
            run_lagged(x, *chosen, self.sample_period, self.jump_period, self.lag, state, w)
        else:
            run_general(x, *chosen, self.sample_period, self.jump_period, state, w)
        return w, state

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.append(np.zeros(len(dx0)), self.own == START), np.array(dx0), np.zeros(len(dx0) + 1)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        w, state = np.empty_like(x), state.copy()
        slopes, last, lagged = (part.copy() for part in tangent)
        rows = np.empty((len(slopes) + 2, x.size))
        chosen = self.loop, self.p1, self.p2
        if self.is_plain and self.own.size == 3 and not len(dx):
            linearise_plain(x, *chosen, state, slopes, w, rows)
        else:
            periods = self.sample_period, self.jump_period
            linearise_general(x, dx, *chosen, self.own, periods, self.lag, state, slopes, last, lagged, w, rows)
        return w, rows, state, (slopes, last, lagged)

    def c_form(self) -> CForm:
        numbers: dict[str, Number] = {"p1": self.p1, "p2": self.p2, "h0": self.start}
        step, library = PLAIN_STEP, self.library
        if self.is_plain:
            numbers |= dict(zip(LOOP[:3], self.loop.tolist(), strict=False))
        else:
            step = GENERAL_STEP
            numbers |= {"loop": self.loop, "period": self.sample_period, "jump_period": self.jump_period}
            if self.tau:
                step, library = LAGGED_STEP, (ADVANCE_IN_C, STEP_AT_SPEED_IN_C)
                numbers |= {"fade": self.lag[:, FADE], "share": self.lag[:, SHARE], "left": self.lag[:, LEFT]}
        rest = "s->h = h0;\ns->v = x;\ns->q = 0.0;\nreturn p1 * x * x * x + p2 * x + h0;"
        return CForm(step, rest, numbers, ("double h, v, q",), library)

    @property
    def library(self) -> tuple[str, ...]:
        """C functions of the step, without a lag of the speed."""
        return ADVANCE_IN_C, *((PLAIN_IN_C,) if self.is_plain else (STEP_AT_SPEED_IN_C, GENERAL_IN_C))

    def inverse_terms(self) -> InverseTerms:
        """The loop without the lag of the speed, which the recursion does not know."""
        periods = self.sample_period, self.jump_period
        loop = LoopTerms(PLAIN if self.is_plain else GENERAL, self.loop, periods, self.start, self.library)
        return InverseTerms(polynomial={"p1": self.p1, "p2": self.p2}, loop=loop)

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(h=state[0])
