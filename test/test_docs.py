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

"""What the pages say holds: code blocks run, commands and links exist, generated tables are those of the code.

Blocks marked ``sh`` and ``python`` run in the order of the page, in one folder; a command that another page has run
there already is not run again. Blocks marked ``console`` need a ROS 2 installation, root, or minutes: what they name
must exist.
"""

import ast
import importlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import piezo_hysteresis
from piezo_hysteresis import export
from piezo_hysteresis.report.live.controls import CONTROLS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"`((?:[\w.]+/)*[\w.]+\.py)`")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")


def blocks(page, *kinds):
    return [(kind, text) for kind, text in BLOCK.findall(page.read_text()) if kind in kinds]


def name(page):
    return str(page.relative_to(ROOT))


runnable = [page for page in PAGES if blocks(page, "sh", "python") and page.name != "CONTRIBUTING.md"]


class Workshop:
    """A folder in which the pages are followed."""

    def __init__(self, folder):
        self.folder = folder
        self._done = set()
        piezo = folder / "bin" / "piezo"
        piezo.parent.mkdir()
        piezo.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m piezo_hysteresis.cli.main "$@"\n')
        piezo.chmod(0o755)
        paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        self._environment = {**os.environ, "PATH": f"{piezo.parent}:{os.environ['PATH']}", "PYTHONPATH": paths}

    def shell(self, text):
        for command in text.replace("\\\n", " ").splitlines():
            if not command.strip() or command in self._done:
                continue
            done = subprocess.run(
                ["sh", "-euc", command],
                cwd=self.folder,
                env=self._environment,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"$ {command}\n{done.stdout}{done.stderr}"
            self._done.add(command)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory):
    return Workshop(tmp_path_factory.mktemp("workshop"))


@pytest.mark.parametrize("page", runnable, ids=name)
def test_code_blocks_run(page, workshop, monkeypatch):
    monkeypatch.chdir(workshop.folder)
    namespace = {"__name__": "page"}
    for kind, text in blocks(page, "sh", "python"):
        if kind == "sh":
            workshop.shell(text)
        else:
            exec(compile(text, f"{name(page)}: python block", "exec"), namespace)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    dead = [to for to in LINK.findall(page.read_text()) if "://" not in to and not (page.parent / to).exists()]
    assert not dead


def slugs(page):
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [ROOT / "docs" / "model.md", ROOT / "docs" / "catalogue.md"], ids=name)
def test_symbols_lead_to_their_entries(page):
    entries = slugs(ROOT / "docs" / "nomenclature.md")
    links = re.findall(r"\[[^\]]*\]\(nomenclature\.md#([^)]*)\)", page.read_text())
    assert len(links) > 50
    assert [link for link in links if link not in entries] == []


def test_symbols_inside_equations_link_to_their_entries():
    linked = runpy.run_path(str(ROOT / "docs" / "symbol_links.py"))["linked"]
    link = re.compile(r"\{\\href\{([^}]*)\}\{((?:[^{}]|\{[^}]*\})*)\}\}")
    _, *sections = (ROOT / "docs" / "model.md").read_text().split("*Symbols:*")
    for section in sections:
        symbols = re.findall(r"\[([^]]*)\]\(nomenclature", section.partition("\n\n")[0])
        equations = [block or inline for block, inline in re.findall(r"\$\$(.*?)\$\$|\$([^$]+)\$", section, re.DOTALL)]
        found = [linked(equation, {symbol: symbol for symbol in symbols}) for equation in equations]
        assert [link.sub(r"\2", equation) for equation in found] == equations, "nothing but links is added"
        used = {symbol for equation in found for symbol, _ in link.findall(equation)}
        assert len(used) >= 0.8 * len(symbols), "the others stand in the text only"
    assert linked(r"\dot h_{i-1} + \mathrm{Cov} h", {"h": "#h"}) == (
        r"\dot {\href{#h}{h}}_{i-1} + \mathrm{Cov} {\href{#h}{h}}"
    )


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_modules_that_are_named_exist(page):
    """Relative to the repository, to the package, or to the page."""
    places = (ROOT, ROOT / "piezo_hysteresis", ROOT / "launch", page.parent)
    assert [file for file in FILE.findall(page.read_text()) if not any((p / file).exists() for p in places)] == []


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "console")], ids=name)
def test_console_blocks_use_existing_commands(page):
    text = "\n".join(text for _, text in blocks(page, "console"))
    targets = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    for target in re.findall(r"^make (\S+)", text, re.MULTILINE):
        assert target in targets
    scripts = re.findall(r"(\w+) = \{NAME\}", (ROOT / "setup.py").read_text())
    for executable in re.findall(r"ros2 run piezo_hysteresis (\S+)", text):
        assert executable in scripts
    for file in re.findall(r"ros2 launch piezo_hysteresis (\S+)", text):
        assert (ROOT / "launch" / file).exists()
    for file in re.findall(r"\b((?:config|examples|docs|benchmarks|scripts)/[\w./]+)", text):
        assert (ROOT / file).exists(), file


def test_generated_docs_are_up_to_date():
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "generate.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_command_behind_a_figure_exists():
    rows = re.findall(r"\| `scripts/run python (\S+)` \|", (ROOT / "README.md").read_text())
    assert rows
    for file in rows:
        assert (ROOT / file).exists(), file


@pytest.mark.soak
def test_the_site_builds_without_a_warning():
    subprocess.run([ROOT / "scripts" / "docs"], check=True, timeout=900)
    site = ROOT / "docs" / "_build" / "html"
    assert 'class="math' in (site / "model.html").read_text()
    assert "piezo_hysteresis.record.Record" in (site / "api.html").read_text()
    assert (site / "searchindex.js").stat().st_size > 10_000


def test_every_page_is_in_the_site():
    index = (ROOT / "docs" / "index.md").read_text().splitlines()
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")} - {"index"}
    assert pages <= set(index)


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "notebooks").glob("*.md")), ids=name)
def test_notebooks_use_existing_names(page):
    cells = re.findall(r"^```{code-cell} python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
    assert len(cells) > 2
    for cell in cells:
        for node in ast.walk(ast.parse(cell, str(page))):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("piezo_hysteresis"):
                module = importlib.import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names)


def test_the_page_about_security_names_every_button():
    (listed,) = re.findall(r"no more\s+\(([^)]*)\)", (ROOT / "docs" / "security.md").read_text())
    assert [button.replace("take a ", "take ") for button in listed.split(", ")] == [c.name.lower() for c in CONTROLS]


def test_the_page_of_the_interface_lists_every_public_name():
    listed = re.findall(r"^\.\. auto\w+:: (\S+)\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    assert all(hasattr(importlib.import_module(module), word) for module, word in listed)
    results = {"Identification", "Diagnosis"}
    assert sorted(word for _, word in listed) == sorted({*piezo_hysteresis.__all__, *export.__all__, *results})
