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

"""`AxesModel`: several drive voltages, several displacements, and a hysteresis for every actuator."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from ..blocks.coupled_axes import coupled_axes
from ..errors import ModelError

Array = NDArray[np.float64]

LINEAR_TERMS = 3
"""Regressors of a drive without hysteresis: u, A u and A² u."""

LONGEST_TIME = 1e3
"""Largest sample period and time constant [s]."""

MOST_SAMPLES = 1e6
"""Largest time constant [sample periods]."""


@dataclass(frozen=True, eq=False, slots=True)
class AxesState:
    """State of an `AxesModel` between two blocks.

    Parameters
    ----------
    power : (1,) array
        Running mean square of the drives [V²].
    history : (s, l - 1, f) array
        The last regressors of every pass.
    plays : (s, m, r) array
        Play operators of every pass [V].
    """

    power: Array
    history: Array
    plays: Array


@dataclass(frozen=True, eq=False, slots=True)
class AxesModel:
    """A full matrix of dynamics with play operators on the elongation of every actuator.

    The first pass is y₀ = Σₗ H₀(l) φ(k − l) with φ = (u, A u, A² u) and A the running rms of the drives over
    `reference`. Every further pass n adds to φ the plays of the elongations z = E yₙ₋₁. The passes replace the
    feedback of the hysteresis on the motion of the structure, so that the model is stable for every value of its taps.

    Parameters
    ----------
    taps : (s, p, l, f) array_like
        Impulse responses of every pass [m/V], the oldest sample first; f = m (3 + number of radii).
    elongation : (m, p) array_like
        From displacements to elongations in volts of drive [V/m].
    radii : (r,) array_like
        Half widths of the play operators [V].
    zero : (p,) array_like
        Sensor zeros [m].
    sample_period : float
        Period at which the taps hold [s].
    reference : float
        Level of the drives at which A = 1 [V].
    memory : float
        Time constant of the running mean square [s].
    level_max : float
        Largest running rms of the drives that was identified [V]; infinite if it is not known.
    free_run_error : (p,) array_like
        RMS error in free run of the records that were not fitted [m], or of those that were; empty if it is not known.

    Raises
    ------
    ModelError
        If shapes do not fit each other, numbers are not finite, or scales are not positive.
    """

    taps: Array
    elongation: Array
    radii: Array
    zero: Array
    sample_period: float
    reference: float
    memory: float
    level_max: float = np.inf
    free_run_error: Array = field(default_factory=lambda: np.empty(0))
    _decay: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("taps", "elongation", "radii", "zero", "free_run_error"):
            value = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if not np.isfinite(value).all():
                raise ModelError(f"{name}: got numbers that are not finite, expected a model of `piezo identify`")
            object.__setattr__(self, name, value)
        for name, most in (("sample_period", LONGEST_TIME), ("reference", np.inf), ("memory", LONGEST_TIME)):
            if not (np.isfinite(getattr(self, name)) and 0 < getattr(self, name) <= most):
                raise ModelError(f"{name}: got {getattr(self, name)!r}, expected a positive number, at most {most:g}")
        if self.memory > MOST_SAMPLES * self.sample_period:
            raise ModelError(f"memory: got {self.memory:g} s, expected at most {MOST_SAMPLES:g} sample periods")
        if not self.level_max > 0:
            raise ModelError(f"level_max: got {self.level_max!r}, expected a positive number")
        if self.elongation.ndim != 2 or self.radii.ndim != 1:
            raise ModelError("elongation, radii: expected two dimensions and one")
        inputs, outputs = self.elongation.shape
        wanted = (outputs, inputs * (LINEAR_TERMS + self.radii.size))
        if self.taps.ndim != 4 or (self.taps.shape[1], self.taps.shape[3]) != wanted or self.zero.shape != (outputs,):
            raise ModelError(
                f"taps: got shape {self.taps.shape}, expected (passes, {wanted[0]}, length, {wanted[1]}) "
                f"and {outputs} zeros for {inputs} drives and {outputs} displacements"
            )
        if self.taps.size == 0 or (self.radii < 0).any() or (self.free_run_error < 0).any():
            raise ModelError("taps, radii, free_run_error: expected at least one tap and no negative width or error")
        if self.free_run_error.shape not in ((0,), (outputs,)):
            raise ModelError(f"free_run_error: got shape {self.free_run_error.shape}, expected ({outputs},)")
        object.__setattr__(self, "_decay", float(np.exp(-self.sample_period / self.memory)))

    @property
    def inputs(self) -> int:
        """Number of drive voltages."""
        return int(self.elongation.shape[0])

    @property
    def outputs(self) -> int:
        """Number of displacements."""
        return int(self.elongation.shape[1])

    @property
    def settling(self) -> int:
        """Number of samples after which a wrong initial state has decayed, apart from that of slow plays."""
        return int(self.taps.shape[0] * self.taps.shape[2] + 5 * self.memory / self.sample_period)

    def levels(self, voltages: Array) -> Array:
        """Running rms of drives (n, m) that begin at rest, shape (n,) [V]."""
        return np.sqrt(lfilter([1.0 - self._decay], [1.0, -self._decay], np.mean(voltages**2, axis=1)))

    def rest(self) -> AxesState:
        """State of a stage that has rested at 0 V."""
        passes, _, length, terms = self.taps.shape
        return AxesState(
            np.zeros(1), np.zeros((passes, length - 1, terms)), np.zeros((passes, self.inputs, self.radii.size))
        )

    def run(self, voltages: ArrayLike, state: AxesState) -> tuple[Array, AxesState]:
        """Displacements [m] of the next samples, and the state after them.

        Bit-identical for every way of cutting the voltages into blocks.

        Parameters
        ----------
        voltages : (n, m) array_like
            Drive voltages [V], one column per actuator, at the sample period of the model.
        state : AxesState
            From `rest`, or from the block before.

        Returns
        -------
        y : (n, p) ndarray
            Displacements [m].
        state : AxesState
            For the next block.

        Raises
        ------
        ModelError
            On another number of columns, or samples that are not finite.
        """
        u = np.array(voltages, dtype=np.float64, order="C")
        if u.ndim != 2 or u.shape[0] == 0 or u.shape[1] != self.inputs:
            raise ModelError(f"voltages: got shape {u.shape}, expected (samples, {self.inputs})")
        if not np.isfinite(u).all():
            raise ModelError("voltages: got samples that are not finite, expected numbers; leave them out")
        y, history, power, plays = self._follow(u, state)
        kept = history.shape[1] - (self.taps.shape[2] - 1)
        return y + self.zero, AxesState(power, history[:, kept:].copy(), plays)

    def regressors(self, voltages: Array) -> Array:
        """Regressors φ of the last pass from rest [V], shape (n, f); the output is linear in them."""
        _, history, _, _ = self._follow(np.array(voltages, dtype=np.float64, order="C"), self.rest())
        return history[-1, self.taps.shape[2] - 1 :].copy()

    def _follow(self, u: Array, state: AxesState) -> tuple[Array, Array, Array, Array]:
        passes, _, _, terms = self.taps.shape
        history = np.concatenate((state.history, np.zeros((passes, u.shape[0], terms))), axis=1)
        power, plays, y = state.power.copy(), state.plays.copy(), np.empty((u.shape[0], self.outputs))
        coupled_axes(u, self.taps, self.elongation, self.radii, self._decay, self.reference, power, history, plays, y)
        return y, history, power, plays
