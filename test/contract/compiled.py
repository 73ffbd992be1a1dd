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

"""Exported C code, compiled with every warning and under the sanitizers, and run."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

STRICT = ("-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic")
CHECKED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""Bad addresses, overflow and undefined behaviour end the program."""

needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine to compile C with")

MAIN = """\
#include "piezo.h"
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **words)
{
    static double row[ROWS][SIZE], out[SIZE];
    piezo_STATE state;
    const size_t cut = SIZE / 3;
    size_t i;
    if (count != 2 || fread(row, sizeof row[0], ROWS, stdin) != ROWS) {
        return 2;
    }
    piezo_RESET(&state, atof(words[1]));
    for (i = 0; i < cut; i++) {
        out[i] = piezo_STEP(&state, row[0][i]STEPPED);
    }
    i = piezo_RUN(&state, row[0] + cut, RUNNING out + cut, SIZE - cut);
    fwrite(out, sizeof out[0], cut + i, stdout);
    return 0;
}
"""
"""Reads rows of doubles, sends a third of them sample by sample and the rest as a block."""


def compiled(files: Mapping[str, str], folder: Path, *flags: str, main: str = "piezo_test.c") -> Path:
    """The program that the files make, with every warning an error."""
    for name, text in files.items():
        (folder / name).write_text(text)
    program = folder / main.removesuffix(".c")
    command = ["gcc", *STRICT, *(flags or CHECKED), "piezo.c", main, "-lm", "-o", program.name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def run_c(
    files: Mapping[str, str], folder: Path, start: float, rows: Sequence[np.ndarray], part: str = "", *flags: str
) -> np.ndarray:
    """Output of the exported prediction, or of another `part`, for rows (input, channels …) after rest at `start`."""
    words = {
        "STATE": f"{part}state", "RESET": f"{part}reset", "STEP(": f"{part}step(", "RUN(": f"{part}run(",
        "STEPPED": "".join(f", row[{k}][i]" for k in range(1, len(rows))),
        "RUNNING": "".join(f"row[{k}] + cut," for k in range(1, len(rows))),
        "ROWS": str(len(rows)), "SIZE": str(len(rows[0])),
    }  # fmt: skip
    main = MAIN
    for word, text in words.items():
        main = main.replace(word, text)
    program = compiled({**files, "main.c": main}, folder, *flags, main="main.c")
    done = subprocess.run(
        [program, repr(float(start))],
        input=np.array(rows, dtype=np.float64).tobytes(),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return np.frombuffer(done.stdout)
