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

"""The linters of ROS 2 find nothing, with the settings of setup.cfg; skipped where they are not installed."""

import re
from configparser import ConfigParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CHECKED = ["benchmarks", "docs", "examples", "launch", "piezo_hysteresis", "scripts", "setup.py"]
"""Everything but tests, whose docstrings no rule shapes."""


@pytest.fixture(autouse=True)
def _in_the_repository(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.mark.linter
@pytest.mark.copyright
def test_ament_copyright():
    ament_copyright = pytest.importorskip("ament_copyright.main")
    assert ament_copyright.main([*CHECKED, "test"]) == 0


@pytest.mark.linter
@pytest.mark.flake8
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # its own, of its plug-ins
def test_ament_flake8():
    ament_flake8 = pytest.importorskip("ament_flake8.main")
    status, errors = ament_flake8.main_with_errors(["--config", "setup.cfg", *CHECKED, "test"])
    assert status == 0, "\n".join(errors)


@pytest.mark.linter
@pytest.mark.pep257
def test_ament_pep257():
    ament_pep257 = pytest.importorskip("ament_pep257.main")
    settings = ConfigParser()
    settings.read("setup.cfg")
    ignored = re.findall(r"\bD\d{3}\b", settings["flake8"]["extend-ignore"])  # docstrings have one list
    described = [path for path in CHECKED if path != "launch"]  # as in setup.cfg: launch calls what stands there
    assert ament_pep257.main(["--convention", "numpy", "--add-ignore", *ignored, "--", *described]) == 0
