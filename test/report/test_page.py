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

"""The page: one file, nothing from outside, readable by machine, keyboard and eye; verdict first."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import pytest
from matplotlib.image import imread

from piezo_hysteresis.discrepancy import Conclusion
from piezo_hysteresis.effects import CATALOGUE
from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.report.figures.diagnosis.correction import correction
from piezo_hysteresis.report.page import SECTIONS
from piezo_hysteresis.report.tables.answer_tables import (
    correction_table,
    effect_table,
    gap_table,
    rejection_table,
    where_table,
)
from piezo_hysteresis.report.verdict import HEADLINES, answer_verdict, verdict

VOID = {"meta", "img", "br", "link", "hr", "input"}

EFFECT = {"name": "creep", "family": "creep", "member_certain": True, "explained_fraction": 0.97}
"""An effect of an answer."""


class Tags(HTMLParser):
    """Every tag with its attributes; refuses what is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, {k: v or "" for k, v in attributes}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


@pytest.fixture(scope="module")
def tags(drawn):
    return Tags(drawn.html)


def test_needs_no_other_file_and_no_network(drawn, tags):
    links = [a[key] for _, a in tags.found for key in ("src", "href", "srcset", "action", "data") if key in a]
    assert all(link.startswith(("#", "data:")) for link in links)
    assert not tags.all("script")
    assert not tags.all("link")
    assert "url(" not in drawn.html
    assert "@import" not in drawn.html


def test_every_figure_can_be_enlarged_by_mouse_and_keyboard(tags):
    boxes = tags.all("input")
    assert [box["type"] for box in boxes] == ["checkbox"] * len(tags.all("img"))
    assert len({box["aria-label"] for box in boxes}) == len(boxes)


def test_every_figure_is_there_with_words_and_numbers(drawn, tags):
    images = tags.all("img")
    assert len(images) == len(drawn.drawings) == sum(len(figures) for figures in SECTIONS.values())
    assert all(len(a["alt"]) > 40 for a in images)
    names = {d.name for d in drawn.drawings}
    assert {a["download"].removesuffix(".csv") for a in tags.all("a") if "download" in a} == names
    assert {"loops_by_amplitude", "time_series", "residual_maps", "residual_spectrum", "bode", "step", "creep"} <= names


def test_a_screen_reader_finds_the_structure(tags):
    assert tags.all("html")[0]["lang"] == "en"
    headings = [int(tag[1]) for tag, _ in tags.found if re.fullmatch("h[1-6]", tag)]
    assert headings[0] == 1
    assert headings.count(1) == 1
    assert all(b <= a + 1 for a, b in zip(headings, headings[1:], strict=False))
    names = [a["id"] for _, a in tags.found if "id" in a]
    assert len(names) == len(set(names))
    assert {a["href"][1:] for a in tags.all("a") if a.get("href", "").startswith("#")} <= set(names)
    assert {a["aria-labelledby"] for _, a in tags.found if "aria-labelledby" in a} <= set(names)
    assert len(tags.all("caption")) == len(tags.all("table"))
    assert all("scope" in a for a in tags.all("th"))


def test_the_verdict_comes_first_and_in_words(drawn, tags):
    assert drawn.html.index('id="verdict"') < drawn.html.index("<img")
    assert "Missing effect: creep" in tags.words
    assert any("is 0.72 % of the range before and 0.04 % after" in w for w in tags.words)


def test_input_text_is_escaped(drawn, tags):
    assert "phases <named> by their drive" in tags.words
    assert "loses <0.4> on held-out phases" in tags.words
    assert "A stage & its model" in tags.words


def test_the_page_of_a_recording_without_a_model_states_this(bare):
    assert verdict(bare).headline == "The recording, without a model"


def test_saves_every_figure_with_its_data_the_same_as_in_the_page(drawn, saved):
    written = {p.name for p in saved.with_name("page_figures").iterdir()}
    assert written == {f"{d.name}.{kind}" for d in drawn.drawings for kind in ("svg", "png", "csv")}
    inside = re.findall(r"data:image/svg\+xml;base64,([^\"]+)", drawn.html)
    for drawing, text in zip(drawn.drawings, inside, strict=True):
        file = saved.with_name("page_figures") / f"{drawing.name}.svg"
        assert b64decode(text).decode() == file.read_text(encoding="utf-8")
    smallest = min(drawn.drawings, key=lambda d: len(d.svg()))
    assert replace(smallest).svg() == smallest.svg(), "drawn again, it is the same"


def test_a_place_that_cannot_be_written_is_reported(drawn, saved):
    with pytest.raises(RecordingError, match="expected a folder"):
        drawn.save(saved / "in_a_file.html")


@pytest.mark.parametrize(
    ("change", "headline"),
    [
        ({"verdict": "nothing_missing", "effects": []}, "Nothing is missing beyond the noise"),
        ({"verdict": "unknown", "effects": []}, "No effect is named"),
        ({"effects": [{**EFFECT, "changed_parameter": "delay"}]}, "A parameter of the model has changed: creep"),
        ({"effects": [EFFECT, {**EFFECT, "name": "extra_delay"}]}, "Missing effects: creep and extra delay"),
    ],
)
def test_an_answer_of_an_older_version_has_a_headline(comparison, answer, change, headline):
    assert verdict(comparison, {**answer, **change}).headline == headline


@pytest.mark.parametrize("conclusion", Conclusion)
def test_the_conclusion_alone_decides_on_the_headline(answer, conclusion):
    """Whatever the sentence of the reason is."""
    stated = {**answer, "verdict": str(conclusion.verdict), "conclusion": str(conclusion), "reason": "No verdict."}
    headline = answer_verdict(stated).headline
    assert headline == HEADLINES[conclusion].format(names="creep", s="")
    assert [word for word, text in HEADLINES.items() if text.format(names="creep", s="") == headline] == [conclusion]


def test_without_a_diagnosis_the_verdict_gives_error_floor_and_worst_phase(comparison):
    said = verdict(comparison)
    now = comparison.now
    assert said.headline == f"The model predicts this experiment to {now.percent:.2g} % of range"
    assert any("floor" in s for s in said.sentences)
    assert any("Before" in s for s in said.sentences)


PROBE = """<script>
addEventListener("load", () => {
  const seen = i => i.complete && i.naturalWidth > 100 && i.getBoundingClientRect().width > 100;
  const images = [...document.images].map(seen);
  const focusable = [...document.querySelectorAll("a[href], [tabindex='0']")];
  const reached = focusable.filter(e => (e.focus(), document.activeElement === e));
  const width = document.images[0].getBoundingClientRect().width;
  document.querySelector(".zoom input").click();
  const grown = document.images[0].getBoundingClientRect().width / width;
  const wide = document.documentElement.scrollWidth > innerWidth;
  document.title = JSON.stringify({images, reached: reached.length, wide, grown});
});
</script></body>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium on this machine")
def test_a_browser_shows_every_figure_and_reaches_every_link_by_keyboard(drawn, tags, tmp_path):
    probed = tmp_path / "probed.html"
    probed.write_text(drawn.html.replace("</body>", PROBE), encoding="utf-8")
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}/profile"]
    command += ["--window-size=500,900", "--enable-logging=stderr", "--virtual-time-budget=20000", "--dump-dom"]
    done = subprocess.run([*command, probed.as_uri()], capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr
    title = re.search("<title>(.*?)</title>", done.stdout)
    page = json.loads(title[1].replace("&quot;", '"'))
    assert page["images"] == [True] * len(drawn.drawings)
    links = len(tags.all("a")) + sum(a.get("tabindex") == "0" for _, a in tags.found)
    assert page["reached"] == links
    assert page["grown"] > 1.5, "a click enlarges a figure"
    assert not page["wide"], "nothing scrolls sideways but tables and figures in their own frames"


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium on this machine")
@pytest.mark.parametrize("style", ["page.css", "live/page.css"])
def test_a_browser_in_dark_mode_leaves_the_page_light(tmp_path, style):
    """It would turn the black lines and words of the figures white, on figures that stay white."""
    page, picture = tmp_path / "page.html", tmp_path / "page.png"
    css = (files("piezo_hysteresis.report") / style).read_text(encoding="utf-8")
    page.write_text(f"<!DOCTYPE html><style>{css}</style><p>words", encoding="utf-8")
    dark = ["--force-dark-mode", "--enable-features=WebContentsForceDark", f"--screenshot={picture}"]
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}/profile", *dark]
    subprocess.run([*command, page.as_uri()], capture_output=True, timeout=120, check=True)
    assert imread(picture)[-1, -1, :3].min() == 1.0


def test_a_correction_without_a_name_is_drawn_and_tabled_only_where_it_is_accepted(answer):
    shape = {
        "x": {"name": "position", "unit": "m", "values": [0.0, 1e-6, 2e-6]},
        "y": {"name": "deviation", "unit": "m", "values": [0.0, 4e-9, 0.0]},
    }
    found = {"accepted": True, "reason": "A correction.", "depends_on": "position", "shape": shape}
    accepted = {**answer, "verdict": "unknown", "effects": [], "unnamed_correction": found}
    refused = {**accepted, "unnamed_correction": {**found, "accepted": False}}
    assert correction_table(accepted).rows[1] == ("1e-06", "4e-09")
    assert correction(accepted).data["deviation_nm"].tolist() == pytest.approx([0.0, 4.0, 0.0])
    assert correction_table(refused) is None and correction(refused) is None
    assert "A correction." in answer_verdict(refused).sentences


def test_the_numbers_under_the_verdict_are_those_of_the_answer(drawn, answer):
    gap = answer["gap_percent_of_range"]
    shown = dict(re.findall(r"<dt>([^<]*)</dt>\s*<dd>([^<]*)</dd>", drawn.html))
    assert [shown[f"error {when}, test records"] for when in ("before", "after")] == [
        f"{gap[when]:.3g} %" for when in ("before", "after")
    ]
    assert shown["noise floor"] == f"{gap['floor']:.3g} %"


def test_an_array_is_shown_in_one_row():
    weights = {f"c[{k}]": {"value": 0.01 * k, "interval_95": [0.0, 1.0], "unit": "1"} for k in range(12)}
    effect = {"name": "plays", "family": "f", "explained_fraction": 1.0, "confusable_with": [], "parameters": weights}
    (row,) = effect_table({"effects": [effect]}).rows
    assert row[-3:] == ("c [1]", "12 from 0 to 0.11", "")


def test_tables_of_a_diagnosis_agree_with_its_answer(answer):
    (effect,) = effect_table(answer).rows
    assert effect[:3] == ("creep", "creep", "97 %")
    assert effect[-3:] == ("gamma [1/decade]", "0.0143", "0.0139 … 0.0147")
    assert gap_table(answer).rows == (
        ("triangle", "0.900", "0.050", "0.030"),
        ("all phases", "0.720", "0.040", "0.030"),
    )
    assert where_table(answer).rows[0][:2] == ("time since level change", "81 %")
    assert rejection_table(answer).rows == (("thermal_drift", "loses <0.4> on held-out phases"),)
    empty = {"verdict": "nothing_missing", "effects": [], "where": [], "rejected": []}
    assert [t(empty) for t in (effect_table, gap_table, where_table, rejection_table)] == [None] * 4


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ([], None),
        (["creep"], "The data cannot distinguish thermal drift from creep."),
        (["creep", "gain_drift"], "The data cannot distinguish thermal drift from creep or gain drift."),
    ],
)
def test_a_rival_of_another_family_leaves_the_family_open(rivals, said):
    drift = EFFECT | {"name": "thermal_drift", "family": "drift", "confusable_with": rivals}
    answer = {"verdict": "named", "reason": "Drift.", "effects": [drift | {"member_certain": not rivals}]}
    assert [s for s in answer_verdict(answer).sentences if "distinguish" in s] == ([said] if said else [])


def test_a_rival_of_the_same_family_leaves_only_the_member_open():
    drift = next(e for e in CATALOGUE if e.name == "thermal_drift")
    same = [e.public_name() for e in CATALOGUE if e.family == drift.family and e is not drift][:1]
    found = EFFECT | {"name": drift.name, "family": drift.family, "confusable_with": same}
    sentences = answer_verdict({"verdict": "named", "reason": "Drift.", "effects": [found]}).sentences
    assert any(s.endswith(f"; the family ({drift.family}) is certain.") for s in sentences)
