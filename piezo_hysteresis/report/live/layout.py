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

"""`lay_out`: parts of a page in their places, by one template for the live page and for recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from itertools import count

from bokeh.document import Document
from bokeh.models import CustomJS, Div, InlineStyleSheet, UIElement

TICK = 250
"""Time between two drawings [ms]."""

_WATCH = """
const page = document.body
const search = () => fetch("static/js/bokeh.min.js", {method: "HEAD", cache: "no-store"})
  .then(answer => { if (answer.ok && !page.classList.contains("live")) location.reload() }, () => {})
clearInterval(page.search)
clearTimeout(page.silence)
page.classList.add("live")
page.silence = setTimeout(() => {
  page.classList.remove("live")
  page.search = setInterval(search, 10000)
}, 3000)
"""
"""Runs in the browser at every drawing. Without one for 3 s the page is marked, because its numbers are old, and it is
loaded anew if the server answers 10 s later and does not draw. The buttons of the head remain: a stop that arrives
late is better than none."""


@dataclass(frozen=True, slots=True)
class Section:
    """One box of the page.

    Parameters
    ----------
    part : bokeh UIElement
        Content of the box; it needs a name.
    title : str
        Heading of the box.
    classes : str
        ``half`` takes half of the width of a wide window, ``screen-only`` is not printed.
    """

    part: UIElement
    title: str = ""
    classes: str = ""

    @property
    def root(self) -> str:
        """Name by which the template finds the part."""
        return str(self.part.name)


def lay_out(
    document: Document,
    heading: str,
    top: Sequence[UIElement],
    sections: Sequence[Section],
    draw: Callable[[], None],
) -> None:
    """Fill a document, and draw it from now on. The browser marks a page that is not drawn any more.

    Parameters
    ----------
    document : bokeh Document
        Empty so far.
    heading : str
        Title of the page, plain text.
    top : sequence of bokeh UIElement
        Stand in the head of the page, which does not scroll away on a wide screen.
    sections : sequence of Section
        Boxes, in order.
    draw : callable
        Called at once, and then in every `TICK`.
    """
    document.config.update(reconnect_session=False, notify_connection_status=False)  # to other models, after a restart
    drawn, numbers = sections[0].part, count(1)
    drawn.js_on_change("tags", CustomJS(code=_WATCH))

    def tick() -> None:
        draw()
        drawn.tags = [next(numbers)]

    for part in (*top, *(section.part for section in sections)):
        document.add_root(part)
    document.title = heading
    document.template = _text("page.html.jinja")
    document.template_variables.update(
        heading=escape(heading), page_css=_text("page.css"), top=[part.name for part in top], sections=list(sections)
    )
    tick()
    document.add_periodic_callback(tick, TICK)


def text_panel(name: str, styles: InlineStyleSheet) -> Div:
    """A place for text, `styles` from `panel_styles` of the same document."""
    return Div(text="", name=name, stylesheets=[styles], sizing_mode="stretch_width")


def panel_styles() -> InlineStyleSheet:
    """How texts look; one per document."""
    return InlineStyleSheet(css=_text("panels.css"))


@cache
def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
