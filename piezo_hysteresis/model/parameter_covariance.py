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

"""`ParameterCovariance`: the covariance of the numbers of a model, and its form in a model file.

`response_error` says how uncertain they make the frequency response.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Section
from ..errors import ModelError, ParameterError

if TYPE_CHECKING:
    from .model import Model

Array = NDArray[np.float64]
Response = NDArray[np.complex128]

NEGLIGIBLE = 1e-12
"""Share of the largest variance, in units of the standard errors, below which a direction counts as exactly known."""
DIGITS = 9
"""Significant digits of a factor: the coefficients of dynamics nearly cancel, and their errors with them."""
STEP = 1e-3
"""Step of a number for the derivative of the response, in units of its standard error."""


@dataclass(frozen=True, slots=True)
class ParameterCovariance:
    """Covariance of a model's numbers, as the fit states it.

    It is stored as a factor F, so that a file gives back the written numbers, bit for bit.

    Parameters
    ----------
    names : tuple of str
        ``"bouc_wen.A"``, …
    factor : tuple of float
        F, row by row, with the covariance F Fᵀ; it has one column for every uncertain direction.

    Raises
    ------
    ModelError
        If the factor does not have the same number of finite values for every name.

    Examples
    --------
    >>> known = ParameterCovariance.of(["creep.gamma", "offset.y0"], np.diag([1e-6, 4e-18]))
    >>> bool(np.allclose(known.matrix, np.diag([1e-6, 4e-18]), rtol=1e-8, atol=0.0))
    True
    """

    names: tuple[str, ...]
    factor: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.names or len(self.factor) % len(self.names) or not np.isfinite(self.factor).all():
            raise ModelError(
                f"covariance: got a factor of {len(self.factor)} values for {len(self.names)} numbers, expected the "
                "same number of finite values for each"
            )

    @classmethod
    def of(cls, names: Sequence[str], matrix: Array) -> ParameterCovariance:
        """From the covariance (q, q) in the units of the numbers."""
        errors = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
        scale = np.where(errors > 0.0, errors, 1.0)
        variances, directions = np.linalg.eigh(matrix / np.outer(scale, scale))
        uncertain = variances > NEGLIGIBLE * max(variances.max(), 0.0)
        rows = scale[:, None] * directions[:, uncertain] * np.sqrt(variances[uncertain])
        return cls(tuple(names), tuple(float(f"{value:.{DIGITS}g}") for value in rows.ravel()))

    @property
    def matrix(self) -> Array:
        """Covariance (q, q) in the units of the numbers."""
        rows = np.array(self.factor).reshape(len(self.names), -1)
        return np.asarray(rows @ rows.T)

    def errors_with(self, names: Sequence[str], slopes: Array) -> Array:
        """Standard errors (k,) of quantities with these slopes (q, k) with numbers of the model."""
        at = [self.names.index(name) for name in names]
        variance = np.einsum("ki,kl,li->i", slopes, self.matrix[np.ix_(at, at)], slopes, optimize=True)
        return np.sqrt(np.maximum(variance, 0.0))


def response_error(model: Model, names: Sequence[str], covariance: Array, frequency: Array) -> Array:
    """Relative standard error of the response of the linear dynamics, shape (k,).

    The error of the complex value follows from the covariance of the coefficients. The coefficients alone have no
    meaning, because poles and zeros of a high order nearly cancel.

    Parameters
    ----------
    model : Model
        Identified model.
    names : sequence of str
        Uncertain numbers (q); those that do not act on the linear dynamics have no effect.
    covariance : (q, q) ndarray
        Their covariance, in their own units.
    frequency : (k,) ndarray
        Below half the sampling rate [Hz].
    """
    z = np.exp(-2j * np.pi * np.asarray(frequency) * model.sample_period)
    values = model.values()
    slopes = np.zeros((len(names), z.size), dtype=np.complex128)
    for row, name in enumerate(names):
        step = STEP * float(np.sqrt(covariance[row, row]))
        if name in values and step > 0.0:
            slopes[row] = _relative_slope(model, name, values[name], step, z)
    variance = np.einsum("ki,kl,li->i", slopes.conj(), covariance, slopes).real
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _relative_slope(model: Model, name: str, value: float, step: float, z: Response) -> Response:
    """Slope of the logarithm of the response with a number, at z = exp(−jωT), in powers of which the sections stand.

    The coefficients of the sections are linear in most numbers, and the response is not: near a slow pole, whose
    denominator nearly vanishes, only their slopes can be taken by a finite step.
    """
    try:
        moved = model.with_values({name: value + step})
    except ParameterError:  # at its bound
        step = -step
        moved = model.with_values({name: value + step})
    total = np.zeros_like(z)
    for own, other in zip(linear_sections(model), linear_sections(moved), strict=True):
        for sign, now, then in zip((1.0, -1.0), own, other, strict=True):
            total = total + sign * np.polyval(np.polysub(then[::-1], now[::-1]) / step, z) / np.polyval(now[::-1], z)
    return total


def linear_sections(model: Model) -> list[Section]:
    """Response of all linear dynamics of the chain."""
    return [section for block in model.at(model.sample_period).blocks for section in block.sections()]
