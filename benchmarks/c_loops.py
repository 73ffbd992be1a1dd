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

"""`CLoops`: the loops of loops.c, compiled on the measured machine, for comparison with the kernels."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
from numpy.ctypeslib import ndpointer

SOURCE = Path(__file__).with_name("loops.c")
ARRAY = ndpointer(np.float64, flags="C_CONTIGUOUS")


def compiler() -> str | None:
    """Path of gcc, None where there is none."""
    return shutil.which("gcc")


class CLoops:
    """Published loop and chain in C.

    Parameters
    ----------
    folder : pathlib.Path
        For the library.
    flags : tuple of str
        Of gcc.
    """

    def __init__(self, folder: Path, flags: tuple[str, ...]) -> None:
        library = folder / f"loops{''.join(flags).replace('=', '_')}.so"
        subprocess.run([str(compiler()), *flags, "-fPIC", "-shared", str(SOURCE), "-o", str(library)], check=True)
        loaded = ctypes.CDLL(str(library))
        self._bouc_wen, self._chain = loaded.bouc_wen, loaded.chain
        self._bouc_wen.argtypes = [ARRAY, ctypes.c_long, ARRAY, ARRAY]
        self._chain.argtypes = [
            *(ARRAY, ctypes.c_long, ctypes.c_double, ctypes.c_double, ARRAY),
            *(ctypes.c_long, ARRAY, ARRAY, ctypes.c_double, ARRAY, ARRAY),
        ]
        self._bouc_wen.restype = self._chain.restype = None

    def bouc_wen(self, v: np.ndarray, p: np.ndarray, w: np.ndarray) -> None:
        """Eq. (6) and (7) for a normalised drive from rest; w is filled."""
        self._bouc_wen(v, v.size, p, w)

    def chain(
        self,
        u: np.ndarray,
        scales: tuple[float, float],
        p: np.ndarray,
        delay: int,
        a: np.ndarray,
        b: np.ndarray,
        w: np.ndarray,
        y: np.ndarray,
    ) -> None:
        """Drive [V] to displacement [m] by loop, delay and ARX; w is room for delay + 7 numbers more, y is filled."""
        self._chain(u, u.size, *scales, p, delay, a, b, float(b.sum() / (1 + a.sum())), w, y)
