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

"""The hash of the code contains every module that computes a result."""

from __future__ import annotations

import subprocess
import sys

from piezo_hysteresis.fleet.code_hash import ROOMS

WITHOUT_INFLUENCE = {
    "__init__.py", "c_form.py", "fleet/__init__.py", "home_path.py", "html_table.py", "picture.py",
    "report/__init__.py",
}  # fmt: skip
"""Modules that the work loads, but that only write C code, find home folders or show something."""
LOADED = """
import sys
from pathlib import Path
import piezo_hysteresis.fleet.work
root = Path(piezo_hysteresis.__file__).parent
files = [Path(m.__file__) for m in list(sys.modules.values()) if getattr(m, "__file__", None)]
print(*(f.relative_to(root).as_posix() for f in files if f.is_relative_to(root)))
"""


def test_every_module_that_the_work_loads_is_in_the_hash():
    loaded = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True).stdout.split()
    assert "discrepancy/diagnose.py" in loaded
    left_out = {file for file in loaded if not any(file == room or file.startswith(f"{room}/") for room in ROOMS)}
    assert left_out == WITHOUT_INFLUENCE
