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

"""Step 2: linear dynamics, an ARX model by least squares (paper, Sec. 3.3).

Least squares minimises the equation error and not the output error: sensor noise on y enters the regressors and biases
A(z). Steiglitz-McBride iterations (prefiltering with 1/A of the step before) remove this bias if the noise is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import lstsq

from ...effects import Arx, Discretisation
from ...errors import IdentificationError, ParameterError
from ...record import Notice, Samples
from ..fit.stable_step import LARGEST_POLE
from .regressors import Signals, triangle

_ALL = slice(None)
"""Selects every regressor."""
DRAWN_IN = 0.9999
"""Largest radius of a pole if rounding errors do not allow the radius above."""

PATIENCE, GAINS = 3, 0.99
"""Number of iterations without improvement that end the search, and error ratio that counts as an improvement."""


@dataclass(frozen=True, eq=False, slots=True)
class Dynamics:
    """G(z) = B(z)/A(z)·z^(−d), Eq. (4) and (5), with its errors on the fitted data.

    Parameters
    ----------
    arx : Arx
        The effect, with a, b and d.
    sample_period : float
        Sample period [s].
    one_step_error : float
        RMS of y minus its prediction from the measured y up to one sample before; ARX minimises it [unit of y].
    free_run_error : float
        RMS of y minus the simulation from the input alone, for the comparison of models [unit of y].
    notices : tuple of Notice
        ``unstable_reflected``, if poles were mirrored into the unit circle.
    """

    arx: Arx
    sample_period: float
    one_step_error: float = float("nan")
    free_run_error: float = float("nan")
    notices: tuple[Notice, ...] = ()

    @property
    def lag(self) -> float:
        """Group delay of G at dc, d and that of B/A [s]."""
        return self.arx.group_delay * self.sample_period

    def response(self, frequency: Samples) -> NDArray[np.complex128]:
        """G at the given frequencies [Hz], complex, shape of `frequency`."""
        return self.arx.response(frequency, self.sample_period)

    def simulate(self, u: Samples) -> Samples:
        """Free-run output for the input `u`, starting settled at its first value, shape (n,)."""
        block = self.arx.block(Discretisation(self.sample_period, self.sample_period))
        y, _ = block.run(u, block.rest(float(u[0]), 0.0))
        return y

    def __str__(self) -> str:
        orders = f"na = {self.arx.array('a').size}, nb = {self.arx.array('b').size}, d = {self.arx['delay']:g}"
        return (
            f"G: {orders}, dc gain {self.arx.dc_gain:.5g}, lag {self.lag * 1e6:.4g} µs, "
            f"one-step error {self.one_step_error:.3g}, free-run error {self.free_run_error:.3g}"
        )


def solve(r: NDArray[np.float64], columns: slice | NDArray[np.intp] = _ALL) -> tuple[Samples, float]:
    """Least squares from the triangular factor: coefficients of some regressors, and the norm of the residual."""
    regressors = r[:, :-1][:, columns]
    scale = np.linalg.norm(regressors, axis=0)
    scale[scale == 0.0] = 1.0
    theta = lstsq(regressors / scale, r[:, -1], check_finite=False)[0] / scale
    return theta, float(np.linalg.norm(r[:, -1] - regressors @ theta))


def reflected(a: Samples, b: Samples) -> tuple[Samples, Samples, int]:
    """Mirror poles outside the unit circle into it, with the same |B/A|; returns a, b and the number mirrored."""
    poles = np.roots(np.concatenate(([1.0], a)))
    outside = np.abs(poles) > LARGEST_POLE
    if not outside.any():
        return a, b, 0
    radius = np.abs(poles[outside])
    poles[outside] *= np.minimum(1.0 / radius, LARGEST_POLE) / radius
    a = np.real(np.poly(poles))[1:]
    # rounding of the coefficients moves poles that crowd near 1, possibly outside again: all are moved inwards
    while (largest := float(np.abs(np.roots(np.concatenate(([1.0], a)))).max())) >= 1.0:
        a = a * (DRAWN_IN / largest) ** np.arange(1, a.size + 1)
    return a, b / np.prod(np.maximum(radius, 1.0)), int(outside.sum())


def settling(a: Samples, b: Samples, delay: int) -> Arx | None:
    """The ARX model with these coefficients; None if it does not settle."""
    try:
        arx = Arx(a=tuple(a.tolist()), b=tuple(b.tolist()), delay=delay)
    except ParameterError:
        return None
    return arx if 1.0 + a.sum() > 0.0 else None


def in_free_run(model: Dynamics, signals: Signals) -> Dynamics:
    """The model with its free-run error on the signals, every record without its mean."""
    squares, count = 0.0, 0
    for u, y in signals:
        error = y - model.simulate(u)
        squares += float(np.sum((error - error.mean()) ** 2))
        count += y.size
    return replace(model, free_run_error=float(np.sqrt(squares / count)))


def identify_arx(
    signals: Signals, delay: int, sample_period: float, orders: tuple[int, int] = (8, 8), iterations: int = 0
) -> Dynamics:
    """ARX model by least squares, with a free offset per record.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record; the input may be the voltage or the hysteresis output.
    delay : int
        d, samples.
    sample_period : float
        Sample period [s].
    orders : (int, int)
        na and nb.
    iterations : int
        Largest number of Steiglitz-McBride iterations after plain least squares; 0 as in the paper.

    Returns
    -------
    Dynamics
        A stable model with its one-step and its free-run error.

    Raises
    ------
    IdentificationError
        If a record is shorter than the orders, the input does not move, the orders are invalid, or the output does not
        follow the input.

    Notes
    -----
    Paper, Sec. 3.3; Steiglitz and McBride 1965.
    """
    return best_arx(signals, delay, sample_period, orders, (iterations,))[0]


def best_arx(
    signals: Signals, delay: int, sample_period: float, orders: tuple[int, int], iterations: Sequence[int]
) -> list[Dynamics]:
    """`identify_arx` with several largest numbers of iterations at once; models that are the same stand once."""
    na, nb = orders
    if na < 0 or nb < 1 or delay < 1:
        raise IdentificationError(f"ARX: got na = {na}, nb = {nb}, d = {delay}, expected na >= 0, nb >= 1, d >= 1")
    if not any(np.ptp(u) > 0.0 for u, _ in signals):
        raise IdentificationError("ARX: the input does not move; expected a record with excitation, e.g. noise")
    theta, left = solve(triangle(signals, orders, delay))
    one_step = left / float(np.sqrt(sum(y.size for _, y in signals)))
    candidates: list[Dynamics] = []
    for iteration in range(max(iterations) + 1):
        if iteration:
            whitener = np.concatenate(([1.0], candidates[-1].arx.array("a")))
            whitened = [
                (scipy.signal.lfilter([1.0], whitener, u - u[0]), scipy.signal.lfilter([1.0], whitener, y - y[0]))
                for u, y in signals
            ]
            theta, _ = solve(triangle(whitened, orders, delay))
        a, b, mirrored = reflected(theta[:na], theta[na:])
        reflected_notices = (
            Notice(
                "unstable_reflected", f"{mirrored} unstable poles of the ARX model were mirrored into the unit circle"
            ),
        )
        arx = settling(a, b, delay)
        if arx is None:  # the iterations diverge
            if not candidates:
                raise IdentificationError("ARX: got no dynamics that settle, expected an output that follows the input")
            break
        model = Dynamics(arx, sample_period, one_step, notices=reflected_notices if mirrored else ())
        candidates.append(in_free_run(model, signals))
        errors = [c.free_run_error for c in candidates]
        if len(errors) > PATIENCE and min(errors[-PATIENCE:]) > GAINS * min(errors[:-PATIENCE]):
            break
    best = [min(candidates[: most + 1], key=lambda model: model.free_run_error) for most in iterations]
    return list(dict.fromkeys(best))


def delay_of(signals: Signals, longest: int = 16, order: int = 8, sure: float = 5.0) -> int:
    """Delay [samples] without a step phase: the first coefficient of a long B(z) that is not zero.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record.
    longest : int
        Longest delay that is considered.
    order : int
        na, and the number of coefficients of B(z) after the longest delay.
    sure : float
        Smallest significant coefficient, in standard errors.
    """
    regressors = triangle(signals, (order, longest + order), 1)
    theta, left = solve(regressors)
    error = left / np.sqrt(sum(y.size for _, y in signals)) * np.linalg.norm(np.linalg.pinv(regressors[:, :-1]), axis=1)
    onset = np.flatnonzero(np.abs(theta[order:]) > sure * error[order:])
    return min(1 + int(onset[0]), longest) if onset.size else 1
