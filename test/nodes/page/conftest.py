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

"""One browser for the tests of a file (skipped where there is none), and a lab on the launch files' transports.

A process reads the profile of its transports once, and may not reach nodes that have another one. So the profile is
kept for all later labs of the process, and without a browser, which skips these tests, it is not read.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from ..conftest import opened
from ..lab import Lab
from .browser import CHROMIUM, Browser

TRANSPORTS = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_DEFAULT_PROFILES_FILE": str(Path(__file__).parents[3] / "config" / "launch_transports.xml"),
}
"""As the launch files set them, but for this machine only."""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt install chromium")
    browser = Browser(tmp_path_factory.mktemp("browser"))
    try:
        yield browser
    finally:
        browser.close()


@pytest.fixture(scope="module")
def shared_lab(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Lab]:
    """One lab for all tests of a file, on the transports of the launch files."""
    os.environ.update(TRANSPORTS)
    with opened(tmp_path_factory.mktemp("lab")) as lab:
        yield lab


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Folder for pictures of the page; that of the environment variable PAGE_PICTURES where it is set."""
    return Path(os.environ.get("PAGE_PICTURES", tmp_path))
