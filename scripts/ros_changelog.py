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

"""`CHANGELOG.rst` from `CHANGELOG.md`, in the form of REP 132 that bloom and the release tools of catkin read."""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
"""The repository."""
NAME = "piezo_hysteresis"
"""Name of the package."""
UNRELEASED = "Forthcoming"
"""Heading that the release tools replace by a version and a date."""


def in_rst(markdown: str) -> str:
    """The changelog of REP 132 with the versions and the changes of a changelog in Markdown."""
    lines = [*_heading(f"Changelog for package {NAME}", "^")]
    for line in markdown.splitlines():
        if line.startswith("## "):
            title = UNRELEASED if "unreleased" in line else line.removeprefix("## ")
            lines += ["", *_heading(title, "-")]
        elif line.startswith("* "):
            lines.append(_inline(line))
    return "\n".join(lines) + "\n"


def _heading(title: str, mark: str) -> tuple[str, str]:
    return title, mark * len(title)


def _inline(line: str) -> str:
    """Code and links of one line of Markdown in the notation of reStructuredText."""
    parts = re.split(r"(\[[^\]]+\]\([^)]+\)|`[^`]+`)", line)
    for place, part in enumerate(parts):
        if link := re.fullmatch(r"\[([^\]]+)\]\(([^)]+)\)", part):
            parts[place] = f"`{link[1].replace('`', '')} <{link[2]}>`__"
        elif part.startswith("`"):
            parts[place] = f"`{part}`"
    return "".join(parts)


def main() -> int:
    """Write the file beside the one that it is made from."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (ROOT / "CHANGELOG.rst").write_text(in_rst(text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
