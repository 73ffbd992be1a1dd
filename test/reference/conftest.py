"""The scripts of examples/paper, importable, each run once for all tests."""

import functools
import importlib
import json
import sys
from pathlib import Path

import pytest

PAPER = Path(__file__).parents[2] / "examples" / "paper"


@pytest.fixture(scope="session")
def exhibit(tmp_path_factory):
    """exhibit(name): numbers written beside the figure that examples/paper/<name>.py makes."""
    folder = tmp_path_factory.mktemp("paper")
    sys.path.insert(0, str(PAPER))

    @functools.cache
    def numbers(name):
        module = importlib.import_module(name)
        picture = getattr(module, name)().save(folder)
        assert picture.stat().st_size > 10_000, f"{picture} is no figure"
        return json.loads(picture.with_suffix(".json").read_text())

    yield numbers
    sys.path.remove(str(PAPER))
