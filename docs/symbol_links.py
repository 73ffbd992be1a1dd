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

"""Sphinx extension: symbols inside the equations of a page link to their entries in the nomenclature.

The sources stay plain LaTeX. A paragraph that begins with *Symbols:* lists the links of its section; every equation
after it gets them as commands that MathJax turns into links.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

COMMANDS = {
    "β": r"\beta", "γ": r"\gamma", "θ": r"\theta", "κ": r"\kappa", "σ": r"\sigma", "τ": r"\tau", "ω": r"\omega",
    "ℓ": r"\ell", "Δ": r"\Delta ", "ŷ": r"\hat y",
}  # fmt: skip
"""LaTeX of characters in the names of symbols."""
INDICES = "ijkr"
"""Indices that count something: a symbol with one of them has other ones in an equation."""
TEXT = {r"\mathrm", r"\mathsf", r"\operatorname", r"\tag", r"\text"}
"""Commands whose argument is text."""
TOKEN = re.compile(r"\\[a-zA-Z]+ ?|\\.|.", re.DOTALL)
"""A command or a character of LaTeX."""
COMMAND_AT_END = re.compile(r"\\[a-zA-Z]+$")
"""A command that the next letter would make another one."""


def latex_of(symbol: str) -> str:
    """LaTeX by which a symbol of the nomenclature is found in an equation."""
    tex = "".join(COMMANDS.get(character, character) for character in symbol.removesuffix("(z)"))
    base, _, index = tex.partition("_")
    if not index or index in INDICES:
        return base
    return f"{base}_{index}" if len(index) == 1 else f"{base}_{{\\{index}}}"


def linked(equation: str, links: Mapping[str, str]) -> str:
    """An equation with links on its symbols.

    Parameters
    ----------
    equation : str
        LaTeX.
    links : mapping of str to str
        Symbol of the nomenclature to its address.
    """
    by_latex = sorted(((latex_of(s), url) for s, url in links.items()), key=lambda pair: -len(pair[0]))
    out, at = [], 0
    while at < len(equation):
        for tex, url in by_latex:
            end = at + len(tex)
            if equation.startswith(tex, at) and not (COMMAND_AT_END.search(tex) and equation[end : end + 1].isalpha()):
                out.append(f"{{\\href{{{url}}}{{{tex}}}}}")
                at = end
                break
        else:
            token = TOKEN.match(equation, at)
            assert token is not None
            at = token.end()
            if token[0].strip() in TEXT:
                at = equation.index("}", at) + 1
            out.append(equation[token.start() : at])
    return "".join(out)


def link_symbols(app: Sphinx, doctree: Any, docname: str) -> None:
    """Link the symbols in all equations of a page."""
    from docutils import nodes

    links: dict[str, str] = {}
    for node in doctree.findall(lambda n: isinstance(n, nodes.paragraph | nodes.math | nodes.math_block)):
        if isinstance(node, nodes.paragraph):
            if node.astext().startswith("Symbols:"):
                links = {link.astext(): link["refuri"] for link in node.findall(nodes.reference)}
        elif links:
            node.children = [nodes.Text(linked(node.astext(), links))]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("doctree-resolved", link_symbols)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
