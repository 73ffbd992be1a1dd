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

"""`ParameterCovariance`: how uncertain the numbers of a model are together, and how a model file holds it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-12
"""Share of the largest variance, in units of the standard errors, below which a direction counts as exactly known."""
DIGITS = 9
"""Significant digits of a factor: the coefficients of dynamics nearly cancel, and their errors with them."""


@dataclass(frozen=True, slots=True)
class ParameterCovariance:
    """Covariance of a model's numbers, as the fit states it.

    It is held by a factor F, so that a file gives back what was written, bit for bit.

    Parameters
    ----------
    names : tuple of str
        ``"bouc_wen.A"``, …
    factor : tuple of float
        F with F Fᵀ the covariance, row by row, as many columns as there are uncertain directions.

    Raises
    ------
    ModelError
        If the factor has not the same number of finite values for each of the names.

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
