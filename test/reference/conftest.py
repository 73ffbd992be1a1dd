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
