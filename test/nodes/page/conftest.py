"""One browser for all tests of a file; they are skipped where there is none."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from .browser import CHROMIUM, Browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt install chromium")
    browser = Browser(tmp_path_factory.mktemp("browser"))
    try:
        yield browser
    finally:
        browser.close()


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Folder for pictures of the page; that of the environment variable PAGE_PICTURES where it is set."""
    return Path(os.environ.get("PAGE_PICTURES", tmp_path))
