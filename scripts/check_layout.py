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

"""What `make lint` checks of the layout: names, sizes, docstrings of constants, rooms of contracts, commit subjects.

Every finding is one line; without findings nothing is printed and the exit status is 0.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from datetime import datetime
from itertools import zip_longest
from pathlib import Path

ROOT = Path(__file__).parents[1]
"""The repository."""
PACKAGE = ROOT / "piezo_hysteresis"
"""The Python package."""
MOST_MODULES = 15
"""Modules in a folder of the package at most, `__init__.py` aside."""
MOST_LINES = 250
"""Lines of a module of the package at most."""
HEADER = 14
"""Lines of the copyright header with the empty line after it, which do not count as lines of a module."""
LONGEST_SUBJECT = 72
"""Characters of the first line of a commit message."""
OUTSIDE = {
    "the runtime never imports an emulator": {"cli", "emulators"},
    "only fleet needs the packages of its extra": {"fleet"},
    "only nodes import ROS": {"nodes"},
    "only report draws": {"cli", "fleet", "nodes", "report"},
}
"""Import contracts that hold for every room, and the rooms that they leave out; `cli` and `nodes` draw by `report`."""
SUBJECTS_SINCE = "2026-11-22T20:40:00+00:00"
"""Commits written before are older than the rule on subjects."""


def findings() -> Iterator[str]:
    """Everything that breaks a rule."""
    modules = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
    yield from repeated_classes(modules)
    yield from full_folders(list(modules))
    yield from long_files(list(modules))
    yield from bare_constants(modules)
    yield from incomplete_contracts(modules)
    yield from without_header()
    yield from long_subjects()


def repeated_classes(modules: dict[Path, ast.Module]) -> Iterator[str]:
    """Public classes of one name in two modules."""
    homes: dict[str, list[str]] = defaultdict(list)
    for path, tree in modules.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(str(path.relative_to(ROOT)))
    for name, paths in homes.items():
        if len(paths) > 1:
            yield f"class {name} stands in {' and '.join(paths)}, expected every public class name once; rename one"


def full_folders(paths: list[Path]) -> Iterator[str]:
    """Folders with too many modules."""
    counts: dict[Path, int] = defaultdict(int)
    for path in paths:
        counts[path.parent] += path.name != "__init__.py"
    for folder, count in counts.items():
        if count > MOST_MODULES:
            yield f"{folder.relative_to(ROOT)} holds {count} modules, expected at most {MOST_MODULES}; group them"


def long_files(paths: list[Path]) -> Iterator[str]:
    """Modules with too many lines."""
    for path in paths:
        lines = len(path.read_text(encoding="utf-8").splitlines()) - HEADER
        if lines > MOST_LINES:
            yield f"{path.relative_to(ROOT)} has {lines} lines, expected at most {MOST_LINES}; split it"


def bare_constants(modules: dict[Path, ast.Module]) -> Iterator[str]:
    """Constants (capitals) of a module or a class that no docstring follows."""
    for path, tree in modules.items():
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for node, following in (pair for owner in (tree, *classes) for pair in zip_longest(owner.body, owner.body[1:])):
            names = _constants(node)
            if names and not _is_docstring(following):
                where = f"{path.relative_to(ROOT)}:{node.lineno}"
                yield f"{where}: constant {', '.join(names)} has no docstring; say below it what it is, with its unit"


def _constants(node: ast.stmt) -> list[str]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    names = [inner.id for target in targets for inner in ast.walk(target) if isinstance(inner, ast.Name)]
    return names if all(name.isupper() and len(name) > 1 for name in names) else []


def _is_docstring(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def incomplete_contracts(modules: Iterable[Path]) -> Iterator[str]:
    """Import contracts that do not name every room that they are for."""
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in modules} - {"__init__"}
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = {c["name"]: c for c in settings["tool"]["importlinter"]["contracts"]}
    for name, outside in OUTSIDE.items():
        named = {module.rpartition(".")[2] for module in contracts[name]["source_modules"]}
        for room in sorted(rooms - outside - named):
            yield f"pyproject.toml: contract '{name}' does not name {room}, expected every room; add it"


def without_header() -> Iterator[str]:
    """Files of Python or C that do not begin with the copyright header that ament_copyright looks for."""
    command = ("git", "-C", str(ROOT), "ls-files", "*.py", "*.c", "*.h")
    for name in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split():
        text = (ROOT / name).read_text(encoding="utf-8")
        if text and not re.match(r"(#!.*\n)?(#|//) Copyright \d{4} .*\n.*\n.* Licensed under the Apache License", text):
            yield f"{name} has no copyright header, expected the one of its neighbours"


def long_subjects() -> Iterator[str]:
    """New commits whose subject is too long; a copy without history has none."""
    command = ["git", "-C", str(ROOT), "log", "--format=%h%x09%aI%x09%s"]
    try:
        log = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return
    since = datetime.fromisoformat(SUBJECTS_SINCE)
    for line in log.splitlines():
        commit, written, subject = line.split("\t", 2)
        if datetime.fromisoformat(written) >= since and len(subject) > LONGEST_SUBJECT:
            yield f"commit {commit}: subject of {len(subject)} characters, expected {LONGEST_SUBJECT}; reword it"


if __name__ == "__main__":
    found = list(findings())
    sys.stdout.writelines(f"{line}\n" for line in found)
    sys.exit(bool(found))
