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

"""Creep with a few time constants."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.linear import AddedBlock
from ...blocks.low_pass import LowPassBlock, linear_step
from ...c_form import CForm
from ...errors import ParameterError
from ...inverse_terms import InverseStart, InverseTerms, RelaxationTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility

FASTEST = 5e-3
"""Time constant below which a relaxation counts as dynamics and not as creep [s]."""


class CreepExponential(Effect):
    """Creep as a sum of first-order relaxations, the classical model of springs and dampers.

    Parameters
    ----------
    c : sequence of float
        Final share of each relaxation [1].
    tau : sequence of float
        Time constant of each relaxation [s]; as many as `c`.
    """

    name = "creep_exponential"
    invertibility = Invertibility.EXACT
    entry = "creep"
    family = "creep"
    place = ChainPosition.MATERIAL
    equation = "Y/W = 1 + Σ_k c_k/(1 + τ_k s)"
    signature = "The residual grows after each change of level and stops after some τ, unlike logarithmic creep"
    source = "Croft, Shed, Devasia 2001, Kelvin-Voigt creep"
    parameters = (
        Parameter("c", "c_k", "1", (0.0, 0.0), 0.0, 0.2, "final share of each relaxation", "Croft 2001", 0.0, 0.01),
        Parameter("tau", "τ_k", "s", (0.3, 10.0), FASTEST, 1e5, "time constants", "Croft 2001", scale=1.0),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        longest = extent.longest_record
        begin = (max(FASTEST, share * longest) for share in (0.001, 0.01, 0.1))
        return tuple(cls(tau=(tau, 20.0 * tau)) for tau in begin)

    def check(self) -> None:
        if self.array("c").size != self.array("tau").size:
            raise ParameterError(
                f"creep_exponential: got {self.array('c').size} shares c and {self.array('tau').size} time constants "
                "tau, expected the same number of both"
            )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"creep_exponential.{n}" for n in self.free_names())
        return CreepExponentialBlock(names, self.array("c"), self.array("tau"), setting.sample_period)


STEP = """\
const double u = x - s->x_rest;
double y = 0.0, after;
int k;
for (k = 0; k < SIZE; k++) {
    after = left[k] * s->z[k] + lead[k] * u + back[k] * s->last;
    s->z[k] = after;
    y += c[k] * (u + (after - u));
}
s->last = u;
return x + (gain * s->x_rest + y);
"""
"""C code of one sample."""


class CreepExponentialBlock(AddedBlock):
    """x + Σ_k c_k x_k; the state holds last input and x_k for every k."""

    keeps_state = True

    def __init__(self, names: tuple[str, ...], c: Array, tau: Array, sample_period: float) -> None:
        self.names, self.c = names, c
        self.poles = tuple(LowPassBlock("", linear_step(float(t), sample_period)) for t in tau)
        self.gain = float(c.sum())

    @property
    def is_idle(self) -> bool:
        return not self.c.any()

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, 2 * self.c.size))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        parts = np.empty((self.c.size, *x.shape))
        after = [pole.filter(x, z[:, 2 * k : 2 * k + 2], parts[k]) for k, pole in enumerate(self.poles)]
        y[:] = 0.0
        for c, part in zip(self.c, parts, strict=True):
            y += c * (x + part)
        return np.hstack(after) if after else z

    def gain_slopes(self) -> Array:
        return np.repeat([1.0, 0.0], self.c.size)

    def own_rest(self) -> State:
        return np.zeros((self.c.size, 2))

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        states = []
        for k, pole in enumerate(self.poles):
            here, by_share, by_tau = z[2 * k : 2 * k + 2], rows[k], rows[self.c.size + k]
            pole.filter(x[None, :], here[None, :], by_share[None, :])
            by_share += x
            states.append(pole.by_parameter(x, y, here, own[k], by_tau[None, :]))
            by_tau *= self.c[k]
        return np.array(states)

    def c_form(self) -> CForm:
        if not self.c.size:
            return CForm("return x;")
        left, lead, back = np.transpose([pole.step for pole in self.poles])
        numbers = {"SIZE": self.c.size, "left": left, "lead": lead, "back": back, "c": self.c, "gain": self.gain}
        state = ("double x_rest, last", f"double z[{self.c.size}]")
        return CForm(STEP, "memset(s, 0, sizeof *s);\ns->x_rest = x;\nreturn x + gain * x;", numbers, state)

    def inverse_terms(self) -> InverseTerms:
        steps = np.array([pole.step for pole in self.poles]).reshape(-1, 3)
        own = RelaxationTerms(0.0, 1.0 - steps[:, 0], steps[:, 1], self.c, self.gain)
        return InverseTerms(relaxations=own)

    def inverse_start(self, x: float, state: State) -> InverseStart:
        x0, z = state
        return InverseStart(relaxations=(x, x0 + z[0, 1::2]))
