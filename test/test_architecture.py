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

"""docs/architecture.md names files and folders that exist, knows every folder, and answers the twelve tasks."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "piezo_hysteresis"
PAGE = (ROOT / "docs" / "architecture.md").read_text()
NAMED = re.findall(r"`([\w./]+(?:\.\w+|/))`", PAGE)
FOLDERS = sorted(str(file.parent.relative_to(PACKAGE)) for file in PACKAGE.rglob("__init__.py"))
TASKS = 12
MOST_FILES = 4
"""Files that one task may touch."""


def is_there(name):
    return (PACKAGE / name).exists() or (ROOT / name).exists()


def tasks():
    table = PAGE.split("\n## Twelve tasks\n", 1)[1]
    rows = [line for line in table.split("| task |", 1)[1].splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[1:]]


def test_every_file_that_is_named_exists():
    assert len(NAMED) > 50
    assert [name for name in NAMED if not is_there(name)] == []


@pytest.mark.parametrize("folder", [f for f in FOLDERS if f != "."])
def test_every_folder_is_in_the_map(folder):
    assert f"| `{folder}/` |" in PAGE, "run `make docs`: the map is made from the docstrings of the folders"


def test_the_picture_shows_every_room_of_the_package():
    picture = (ROOT / "docs" / "images" / "rooms.svg").read_text()
    drawn = set(re.findall(r'class="room"[^>]*>([\w.]+)/?<', picture))
    rooms = {f for f in FOLDERS if "/" not in f and f != "."}
    assert rooms <= drawn


def test_every_task_names_few_files():
    assert len(tasks()) == TASKS
    for task, files, _ in tasks():
        count = len(re.findall(r"`[^`]+`", files))
        assert 1 <= count <= MOST_FILES, task
