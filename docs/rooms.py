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

"""The rooms of the package: their picture, and the table of every folder with the sentence of its docstring.

Both are read from the code: the levels from the import contract in pyproject.toml, the sentences from the docstrings.
`make docs` writes them into docs/architecture.md and docs/images/rooms.svg.
"""

from __future__ import annotations

import ast
import textwrap
import tomllib
from collections.abc import Iterator
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "piezo_hysteresis"

WIDTH, CHAIN_WIDTH, MARGIN = 1080, 680, 20
"""Width of the picture, and of the column in which the levels stand [px]."""
ROW, GAP = 66, 12
"""Height of a level, and the space between two [px]."""
MOST = 3
"""Boxes side by side; the names of more would not fit into them."""
CLOSE = 4
"""Space between two rows of one level [px]."""
LETTER = 6.3
"""Width of a small letter, about [px]."""

HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img"
     aria-labelledby="t d" font-family="DejaVu Sans, Helvetica, Arial, sans-serif">
<title id="t">The rooms of the package</title>
<desc id="d">Each box is a folder or a module of piezo_hysteresis. A room of the left column
imports only rooms below it. The rooms of the right column stand beside this chain.</desc>
<defs>
  <marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto">
    <path d="M0 0L10 5L0 10z" fill="#333"/></marker>
  <style>
    .chain{{fill:#dcebf7;stroke:#0072b2;stroke-width:1.5}} .beside{{fill:#fdf1e7;stroke:#d55e00;stroke-width:1.5}}
    .room{{font:bold 14px "DejaVu Sans Mono",monospace}} .small{{font-size:11.5px;fill:#333}}
    .head{{font-size:14px;font-weight:bold}}
    .line{{stroke:#333;stroke-width:1.6;marker-end:url(#tip)}}
  </style>
</defs>
<rect width="{width}" height="{height}" fill="#fff"/>
"""


def sentence(path: Path) -> str:
    """First sentence of the docstring of a module, or of a folder."""
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text())) or ""
    return text.split("\n\n")[0].replace("\n", " ").strip()


def contract() -> tuple[list[list[str]], list[str]]:
    """Levels of the import contract from top to bottom, and the rooms that stand beside them."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(c for c in contracts if c["type"] == "layers")
    return [level.split(" | ") for level in layers["layers"]], sorted(layers["exhaustive_ignores"])


def folders() -> Iterator[Path]:
    """Every folder of the package, each before those inside it."""
    yield from sorted(file.parent for file in PACKAGE.rglob("__init__.py") if file.parent != PACKAGE)


def folder_rows() -> Iterator[tuple[str, str]]:
    """Path of every folder, and what it holds."""
    for folder in folders():
        yield f"`{folder.relative_to(PACKAGE)}/`", sentence(folder)


def _box(x: float, y: float, width: float, height: float, name: str, kind: str) -> str:
    label = f"{name}/" if (PACKAGE / name).is_dir() else f"{name}.py"
    lines = textwrap.wrap(
        sentence(PACKAGE / name).replace("`", ""), int((width - 24) / LETTER), max_lines=3, placeholder=" …"
    )
    drawn = [
        f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6"/>',
        f'<text class="room" x="{x + 12:g}" y="{y + 19:g}">{escape(label)}</text>',
    ]
    for k, line in enumerate(lines):
        drawn.append(f'<text class="small" x="{x + 12:g}" y="{y + 35 + 13 * k:g}">{escape(line)}</text>')
    return "\n".join(drawn)


def picture() -> str:
    """The picture as SVG."""
    levels, beside = contract()
    top = 48
    rows = [[level[first : first + MOST] for first in range(0, len(level), MOST)] for level in levels]
    height = top + sum(len(level) * (ROW + CLOSE) - CLOSE + GAP for level in rows) + MARGIN
    drawn = [HEAD.format(width=WIDTH, height=height)]
    drawn.append(f'<text class="head" x="{MARGIN + 24}" y="32">Each room imports only rooms below it.</text>')
    drawn.append(f'<text class="head" x="{MARGIN + CHAIN_WIDTH + 40}" y="32">Beside the chain</text>')
    drawn.append(f'<path class="line" d="M{MARGIN + 4} {top}V{height - MARGIN - GAP}"/>')
    y = top
    for level in rows:
        for row in level:
            width = (CHAIN_WIDTH - 24 - (len(row) - 1) * GAP) / len(row)
            for j, name in enumerate(row):
                drawn.append(_box(MARGIN + 24 + j * (width + GAP), y, width, ROW, name, "chain"))
            y += ROW + CLOSE
        y += GAP - CLOSE
    x, width = MARGIN + CHAIN_WIDTH + 40, WIDTH - CHAIN_WIDTH - 60 - MARGIN
    for k, name in enumerate(beside):
        drawn.append(_box(x, top + k * (ROW + GAP + 14), width, ROW + 14, name, "beside"))
    return "\n".join([*drawn, "</svg>\n"])
