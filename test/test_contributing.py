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

"""CONTRIBUTING's worked example, followed to the letter in a copy of the package."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_six_steps_give_an_effect_that_keeps_the_contract(tmp_path):
    text = (ROOT / "CONTRIBUTING.md").read_text()
    for part in ("piezo_hysteresis", "test/contract", "test/conftest.py", "pyproject.toml"):
        source = ROOT / part
        copy = shutil.copytree if source.is_dir() else shutil.copy2
        copy(source, tmp_path / part)

    file, code = re.search(r"```python\n# file: (\S+)\n(.*?)```", text, re.DOTALL).groups()
    (tmp_path / file).write_text(code)
    diff = re.search(r"```diff\n(.*?)```", text, re.DOTALL)[1].splitlines()
    listing = tmp_path / "piezo_hysteresis/effects/__init__.py"
    lines = listing.read_text().splitlines()
    imports, below, member = diff
    lines.insert(next(i for i, line in enumerate(lines) if line.startswith("from .")), imports[1:])
    lines.insert(lines.index(below[1:], lines.index("CHAIN: tuple[type[Effect], ...] = (")) + 1, member[1:])
    listing.write_text("\n".join(lines) + "\n")

    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test/contract", "-k", "uniform_drift"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) >= 10
