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

"""`make docs`: write what the docs take from the code, so that it is written down once.

The catalogue as a whole; tables between ``<!-- generated: name -->`` and ``<!-- end -->`` in the other pages; the
pictures. ``--check`` writes nothing and fails if a page differs from the code.
"""

from __future__ import annotations

import argparse
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import rooms
import topics

from piezo_hysteresis.acquisition.settings import DRIVER, IN_FORCE
from piezo_hysteresis.effects import BASELINE, CHAIN, UNNAMED, Effect
from piezo_hysteresis.nodes.compensation.settings import COMPENSATION
from piezo_hysteresis.nodes.identification.settings import IDENTIFICATION
from piezo_hysteresis.nodes.model.model_node import MODEL
from piezo_hysteresis.nodes.page.page_node import PAGE
from piezo_hysteresis.nodes.several_axes.axes_model_node import AXES
from piezo_hysteresis.parameter import Parameter, Row, Setting
from piezo_hysteresis.stage.back_ends import BACK_ENDS
from piezo_hysteresis.stage.plant import PlantParameters

DOCS = Path(__file__).parent
PICTURES = DOCS / "pictures.py"
HEAD = """\
# Catalogue of effects

Generated from `piezo_hysteresis/effects` by `make docs`; `piezo effects` prints it too. The effects are listed in
the order in which they act. All except the hysteresis operators and `arx` have a value that switches them off exactly.

"""
UNNAMED_HEAD = """\
# Corrections without a name

These corrections are not effects. `piezo diagnose` offers one of them after the verdict *unknown*
([how](gap.md#a-correction-without-a-name)). A search for effects does not use them.
"""
MARKED = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(head: str, rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table; `head` is its first line without the outer bars."""
    columns = head.split("|")
    lines = [columns, ["---"] * len(columns), *rows]
    return "".join(f"| {' | '.join(cell.strip().replace('|', '&#124;') for cell in line)} |\n" for line in lines)


def number(value: float) -> str:
    """Short."""
    return f"{value:g}"


def default(row: Parameter) -> str:
    """Default value of a parameter; arrays in brackets."""
    return f"[{', '.join(map(number, row.value))}]" if isinstance(row.value, tuple) else number(row.value)


def parameters() -> str:
    """Symbols of all effects, in chain order; symbols of other pages link here."""
    return "\n".join(
        f"### `{e.name}`\n\n"
        + table(
            f"symbol of [`{e.name}`](catalogue.md#{e.name}) | in code | unit | meaning",
            ((p.symbol, f"`{p.name}`", p.unit, p.meaning) for p in e.parameters),
        )
        for e in CHAIN
        if e.parameters
    )


def section(effect: type[Effect]) -> str:
    """One effect: what it is, its equation, how its absence shows, its parameters."""
    summary = (effect.__doc__ or "").strip().splitlines()[0]
    facts = [f"*Family* `{effect.family}`, *place* {effect.place.name.lower()}"]
    if effect.host:
        facts.append(f"a term of `{effect.host}`")
    if effect.channel:
        facts.append(f"needs the channel `{effect.channel}`")
    rows = (
        (
            f"[{p.symbol}](nomenclature.md#{effect.name})",
            f"`{p.name}`",
            p.unit,
            default(p),
            f"{number(p.lower)} … {number(p.upper)}",
            "" if p.off is None else number(p.off),
            p.meaning,
        )
        for p in effect.parameters
    )
    return (
        f"## `{effect.name}`\n\n{summary}\n\n{', '.join(facts)}.\n\n    {effect.equation}\n\n"
        f"*How it shows:* {effect.signature}.\n*Source:* {effect.source}.\n\n"
        + table("symbol | in code | unit | default | bounds | off at | meaning", rows)
    )


def catalogue() -> str:
    """The whole page docs/catalogue.md."""
    named = [e for e in CHAIN if e not in UNNAMED]
    listed = table(
        "effect | family | place | in the published model",
        (
            (f"[`{e.name}`](#{e.name})", f"`{e.family}`", e.place.name.lower(), "yes" if e in BASELINE else "")
            for e in named
        ),
    )
    sections = [section(e) for e in named] + [UNNAMED_HEAD] + [section(e) for e in UNNAMED]
    return HEAD + listed + "\n" + "\n".join(sections)


def settings(rows: Iterable[Row]) -> str:
    """ROS parameters of a node."""
    lines = []
    for row in rows:
        if isinstance(row, Setting):
            value = str(row.value).lower() if isinstance(row.value, bool) else str(row.value)
            allowed = f"{row.lower} … {row.upper}" if row.is_number else ", ".join(row.choices)
            lines.append((f"`{row.name}`", value, "", allowed, row.meaning))
        else:
            bounds = "" if math.isinf(row.upper) else f"{number(row.lower)} … {number(row.upper)}"
            lines.append((f"`{row.name}`", default(row), row.unit, bounds, row.meaning))
    return table("parameter | default | unit | range or choice | meaning", lines)


def driver() -> str:
    """Parameters of the driver and of its back ends; the plant has a page of its own."""
    plant = {row.name for row in PlantParameters.table()}
    behind = (
        replace(row, name=f"{word}.{row.name}")
        for word, back_end in BACK_ENDS.items()
        for row in back_end.rows
        if row.name not in plant
    )
    return settings((*DRIVER, *behind))


def from_ros(heading: str) -> str:
    """The table under a heading of docs/ros.md, which the README repeats."""
    after = (DOCS / "ros.md").read_text().split(f"\n## {heading}\n", 1)[1]
    lines = after.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("|"))
    last = next(i for i in range(first, len(lines)) if not lines[i].startswith("|"))
    return "\n".join(lines[first:last]) + "\n"


TABLES: dict[str, Callable[[], str]] = {
    "parameters": parameters,
    "driver": driver,
    "in_force": lambda: settings(replace(row, name=f"in_force.{row.name}") for row in IN_FORCE),
    "model_node": lambda: settings(MODEL),
    "axes_model_node": lambda: settings(AXES),
    "identification_node": lambda: settings(IDENTIFICATION),
    "compensation_node": lambda: settings(COMPENSATION),
    "page_node": lambda: settings(PAGE),
    "topics": lambda: table("topic | type | unit | QoS | rate | by", topics.rows()),
    "services": lambda: from_ros("Services"),
    "plant": lambda: settings(PlantParameters.table()),
    "rooms": lambda: table("folder | what it holds", rooms.folder_rows()),
}


def filled(text: str) -> str:
    """A page with new tables between its marks."""
    return MARKED.sub(lambda mark: mark[1] + TABLES[mark[2]]() + mark[3], text)


def pages() -> dict[Path, str]:
    """Every page that holds something generated, with the text it should have."""
    marked = [p for p in (DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))) if p.exists()]
    made = {p: filled(p.read_text()) for p in marked if MARKED.search(p.read_text())}
    policy = {topics.POLICY: topics.policy(topics.POLICY.read_text())}
    return {DOCS / "catalogue.md": catalogue(), DOCS / "images" / "rooms.svg": rooms.picture(), **policy, **made}


def main() -> int:
    """Write the pages, or check them; 1 where a page was out of date under ``--check``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; fail where a page differs from the code")
    check = parser.parse_args().check
    stale = [p for p, text in pages().items() if not p.exists() or p.read_text() != text]
    for page in stale:
        print(f"{'out of date, run make docs' if check else 'written'}: {page.relative_to(DOCS.parent)}")
        if not check:
            page.write_text(pages()[page])
    if not check and PICTURES.exists():
        return subprocess.run([sys.executable, PICTURES], check=False).returncode
    return int(check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
