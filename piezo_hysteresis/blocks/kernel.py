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

"""`kernel`: decorator of all per-sample loops: compiled and cached with numba, plain Python without it.

With NUMBA_DISABLE_JIT=1, a variable of numba, they are plain Python too, and numba (60 MB) is not loaded.

A kernel is a top-level function of float64 arrays and scalars, because numba does not cache closures. A new argument
type (read-only, strided) would start a compilation in a running node, so callers pass new contiguous arrays.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., object])


def fma(x: float, y: float, z: float) -> float:
    """x y + z; in a kernel a fused multiply-add with one rounding, which shortens the latency of recursions."""
    return x * y + z


_IS_PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"
"""Whether plain Python was requested."""

try:
    if _IS_PLAIN:
        raise ImportError
    import numba
    from numba.core import event
    from numba.extending import intrinsic, overload
except ImportError:
    if not _IS_PLAIN:
        warnings.warn(
            "numba is not installed: results differ only by rounding, but simulations take about 100 times longer",
            stacklevel=2,
        )

    IS_COMPILED = False

    def kernel(function: F) -> F:
        """Return the loop unchanged, as plain Python."""
        return function

    inlined = summing = kernel

    def on_compilation(call: Callable[[], object]) -> AbstractContextManager[object]:
        """Context in which nothing is compiled."""
        return nullcontext()

else:
    IS_COMPILED = True

    def kernel(function: F) -> F:
        """Compile the loop to machine code at first use and keep it on disk, if a folder for it can be written."""
        return _kept(function)

    def inlined(function: F) -> F:
        """A kernel of one sample that is inlined into the loops that call it, which avoids the cost of a call."""
        return _kept(function, forceinline=True)

    def summing(function: F) -> F:
        """A kernel whose sums may be taken in any order, so that the processor adds several numbers at once."""
        return _kept(function, fastmath={"contract", "nsz", "reassoc"})

    def _kept(function: Any, **options: Any) -> Any:
        options |= {"error_model": "numpy", "nogil": True}
        try:
            loop = numba.njit(cache=True, **options)(function)
        except RuntimeError:  # from numba: no folder for the machine code
            _warn_of_compiling_again()
            return numba.njit(**options)(function)
        return _renewed_with_callees(loop)

    @cache
    def _warn_of_compiling_again() -> None:
        warnings.warn(
            "neither the folder of this package nor a folder for caches can be written: compiled code is not kept, and "
            "every start takes longer; set NUMBA_CACHE_DIR to a folder that can be written",
            stacklevel=4,
        )

    def _renewed_with_callees(loop: Any) -> Any:
        """The loop, compiled anew if a file with a kernel that it calls has changed; numba looks at its own file only.

        The machine code of a loop contains that of the kernels that it calls.
        """
        called = (loop.py_func.__globals__.get(name) for name in loop.py_func.__code__.co_names)
        own, *others = (
            member._cache._cache_file
            for member in (loop, *called)
            if isinstance(member, type(loop)) and hasattr(member._cache, "_cache_file")
        )  # numba has no public way
        own._source_stamp = own._source_stamp, *(other._source_stamp for other in others)
        return loop

    class _FirstCompilation(event.Listener):  # type: ignore[misc]
        """Calls a function when the first kernel is compiled; a kernel that is loaded from disk does not count."""

        def __init__(self, call: Callable[[], object]) -> None:
            self._call: Callable[[], object] | None = call

        def on_start(self, event: object) -> None:
            call, self._call = self._call, None
            if call is not None:
                call()

        def on_end(self, event: object) -> None:
            """Nothing follows."""

    def on_compilation(call: Callable[[], object]) -> AbstractContextManager[object]:
        """Context that calls a function once if a kernel is compiled in it, not only loaded from disk."""
        return event.install_listener("numba:compile", _FirstCompilation(call))

    @intrinsic
    def _rounded_once(typing: Any, x: Any, y: Any, z: Any) -> Any:
        double = numba.types.float64
        return double(double, double, double), lambda context, builder, signature, numbers: builder.fma(*numbers)

    @overload(fma, strict=False)  # annotations count as a difference
    def _fma(x: Any, y: Any, z: Any) -> Any:
        return lambda x, y, z: _rounded_once(x, y, z)
