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

"""`FirBlock`: a delay as a short FIR filter added to the direct path."""

from __future__ import annotations

import numpy as np

from ..c_form import HISTORY, CForm
from .block import Array, Section, State
from .linear import AddedBlock

STEP = """\
const double *u = remember(s->inputs, INPUTS, &s->newest, x - s->x_rest);
double y = direct * u[0];
int k;
for (k = 0; k < TAPS; k++) {
    y += taps[k] * u[FIRST + k];
}
return x + y;
"""
"""C code of one sample."""


class FirBlock(AddedBlock):
    """y_i = Σ_k taps_k x_(i − first − k), with Σ taps = 1.

    Parameters
    ----------
    names : tuple of str
        Parameters on which the taps depend.
    first : int
        Number of whole samples before the first tap.
    taps : (k,) ndarray
        Weights.
    slopes : (p, k) ndarray
        Derivatives of the weights by the parameters.
    """

    def __init__(self, names: tuple[str, ...], first: int, taps: Array, slopes: Array) -> None:
        self.names = names
        self.added = np.concatenate((np.zeros(first), taps))
        self.added[0] -= 1.0
        self.slopes = np.pad(slopes, ((0, 0), (first, 0)))

    def sections(self) -> tuple[Section, ...]:
        """The direct path and the taps, one section without poles."""
        return ((self.added + np.eye(1, self.added.size)[0], np.ones(1)),)

    @property
    def is_idle(self) -> bool:
        return not self.added.any()

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, self.added.size - 1))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        return self._weigh(x, z, self.added, y)

    def own_rest(self) -> State:
        return None

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        for k, weights in enumerate(self.slopes):
            self._weigh(x[None, :], z[None, :], weights, rows[k : k + 1])

    def c_form(self) -> CForm:
        later = np.flatnonzero(self.added[1:]) + 1
        if not later.size:
            return CForm("return x;")
        taps = self.added[later[0] :]
        return CForm(
            STEP,
            "memset(s, 0, sizeof *s);\ns->x_rest = x;\nreturn x;",
            {
                "INPUTS": self.added.size,
                "FIRST": int(later[0]),
                "TAPS": taps.size,
                "direct": self.added[0],
                "taps": taps,
            },
            ("double x_rest", f"double inputs[{2 * self.added.size}]", "int newest"),
            (HISTORY,),
        )

    def _weigh(self, x: Array, z: Array, weights: Array, y: Array) -> Array:
        past, n = np.concatenate((z, x), axis=1), x.shape[1]
        y[:] = 0.0
        for k in np.flatnonzero(weights):
            start = z.shape[1] - k
            y += weights[k] * past[:, start : start + n]
        return past[:, n:].copy()
