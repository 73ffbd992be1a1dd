"""`kernel`: the decorator of every per-sample loop. Compiled and cached with numba, plain Python without it.

A kernel is a top-level function of float64 arrays and scalars: numba never caches closures, and a new argument type
(read-only, strided) would compile again in a running node, so callers hand over fresh contiguous arrays.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TypeVar

F = TypeVar("F", bound=Callable[..., object])

try:
    import numba
except ImportError:
    warnings.warn("numba is not installed: same results, but simulations run about 100 times slower", stacklevel=2)

    def kernel(function: F) -> F:
        """Leave the loop as plain Python."""
        return function

else:

    def kernel(function: F) -> F:
        """Compile the loop to machine code at first use and keep it on disk."""
        return numba.njit(cache=True, error_model="numpy", nogil=True)(function)
