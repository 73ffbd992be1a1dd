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

"""`thinned`: fewer points to draw, with all extremes kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def thinned(values: NDArray[np.float64], points: int = 1200) -> NDArray[np.intp]:
    """Indices to draw: the smallest and the largest sample of every bin, and both ends.

    Parameters
    ----------
    values : (n,) ndarray
        Samples that will be drawn as a line.
    points : int
        Approximate number of indices.

    Examples
    --------
    >>> y = np.zeros(10_000); y[1234] = 1.0
    >>> 1234 in thinned(y), thinned(y).size <= 1200
    (True, True)
    """
    if values.size <= points:
        return np.arange(values.size)
    per_bin = -(-2 * values.size // (points - 4))
    whole = values.size // per_bin
    rows = values[: whole * per_bin].reshape(whole, per_bin)
    first = per_bin * np.arange(whole)
    rest = values[whole * per_bin :]
    tail = whole * per_bin + np.array([rest.argmin(), rest.argmax()]) if rest.size else np.empty(0, dtype=np.intp)
    ends = np.array([0, values.size - 1])
    return np.unique(np.concatenate((ends, first + rows.argmin(axis=1), first + rows.argmax(axis=1), tail)))
