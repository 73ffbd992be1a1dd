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

"""What kernels promise beyond being fast."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from piezo_hysteresis.blocks.kernel import fma, kernel

EPSILON = 2.0**-30


@kernel
def less_than_a_square(x: float) -> float:
    """(1 + x)(1 − x) − 1 = −x²."""
    return fma(1.0 + x, 1.0 - x, -1.0)


def test_product_and_sum_are_rounded_once():
    assert (1.0 + EPSILON) * (1.0 - EPSILON) - 1.0 == 0.0  # rounded twice, the square is lost
    assert less_than_a_square(EPSILON) == -(EPSILON**2)


def test_numba_is_not_loaded_where_its_own_variable_switches_it_off():
    program = (
        "import sys; from piezo_hysteresis.blocks.kernel import kernel; f = lambda: 0; "
        "assert kernel(f) is f and 'numba' not in sys.modules"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-W", "error", "-c", program], env=environment, check=True)


@pytest.mark.parametrize("decorator", ["kernel", "inlined"])
def test_a_loop_is_compiled_anew_after_a_change_of_a_kernel_that_it_calls(tmp_path, decorator):
    """After an update, numba would take the old machine code of loops whose own files have not changed."""
    head = f"from piezo_hysteresis.blocks.kernel import {decorator}\n\n@{decorator}\n"
    (tmp_path / "twice.py").write_text(f"from once import once\n{head}def twice(x):\n    return once(once(x))\n")
    (tmp_path / "loop.py").write_text(f"from twice import twice\n{head}def loop(x):\n    return twice(x)\n")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    found = []
    for added in ("1.0", "10.0"):
        (tmp_path / "once.py").write_text(f"{head}def once(x):\n    return x + {added}\n")
        command = [sys.executable, "-c", "from loop import loop; print(loop(0.0))"]
        run = subprocess.run(command, env=environment, cwd=tmp_path, check=True, capture_output=True, text=True)
        found.append(float(run.stdout))
    assert found == [2.0, 20.0]


def test_a_compilation_is_reported_once_and_loading_is_not(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        """
from piezo_hysteresis.blocks.kernel import kernel, on_compilation

@kernel
def first(x):
    return x + 1.0

@kernel
def second(x):
    return x + 2.0

with on_compilation(lambda: print("compiling")):
    print(first(1.0), second(1.0))
"""
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, str(program)]
    runs = [subprocess.run(command, env=environment, check=True, capture_output=True, text=True) for _ in range(2)]
    assert [run.stdout for run in runs] == ["compiling\n2.0 3.0\n", "2.0 3.0\n"]


def test_without_a_folder_for_machine_code_kernels_are_compiled_at_every_start(tmp_path):
    """Numba refused to load them, which ended every node of a package whose folder and HOME are read-only."""
    program = tmp_path / "program.py"
    program.write_text(
        """
from numba.core import caching

folders = getattr(caching, "CacheImpl", None) or caching._CacheImpl  # the name in older versions
folders._locator_classes = []  # none can be written
from piezo_hysteresis.blocks.kernel import inlined, kernel

@inlined
def once(x):
    return x + 1.0

@kernel
def twice(x):
    return once(once(x))

print(twice(1.0))
"""
    )
    run = subprocess.run([sys.executable, str(program)], check=True, capture_output=True, text=True)
    assert run.stdout == "3.0\n"
    assert run.stderr.count("set NUMBA_CACHE_DIR to a folder that can be written") == 1
