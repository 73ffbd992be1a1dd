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

"""`kernel`: the decorator of every per-sample loop. Compiled and cached with numba, plain Python without it.

Numba's own variable NUMBA_DISABLE_JIT=1 asks for plain Python too; numba, 60 MB, is not loaded then.

A kernel is a top-level function of float64 arrays and scalars: numba never caches closures, and a new argument type
(read-only, strided) would compile again in a running node, so callers hand over fresh contiguous arrays.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., object])


def fma(x: float, y: float, z: float) -> float:
    """x y + z; in a kernel rounded once, in one instruction, where a recursion would wait for two."""
    return x * y + z


_IS_PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"
"""Whether plain Python is asked for."""

try:
    if _IS_PLAIN:
        raise ImportError
    import numba
    from numba.extending import intrinsic, overload
except ImportError:
    if not _IS_PLAIN:
        warnings.warn(
            "numba is not installed: same results but for rounding, and simulations run about 100 times slower",
            stacklevel=2,
        )

    def kernel(function: F) -> F:
        """Leave the loop as plain Python."""
        return function

    inlined = kernel
else:

    def kernel(function: F) -> F:
        """Compile the loop to machine code at first use and keep it on disk."""
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)

    def inlined(function: F) -> F:
        """A kernel of one sample that is compiled into the loops that call it: this avoids the cost of a call."""
        return numba.njit(cache=True, error_model="numpy", nogil=True, forceinline=True)(function)

    @intrinsic
    def _rounded_once(typing: Any, x: Any, y: Any, z: Any) -> Any:
        double = numba.types.float64
        return double(double, double, double), lambda context, builder, signature, numbers: builder.fma(*numbers)

    @overload(fma, strict=False)  # annotations count as a difference
    def _fma(x: Any, y: Any, z: Any) -> Any:
        return lambda x, y, z: _rounded_once(x, y, z)
