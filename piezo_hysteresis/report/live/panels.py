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

"""Texts of the page: state, alarms, model and its history, identification; from an `AxisState` to HTML."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from html import escape

import numpy as np

from ...errors import printable
from ..words import nanometre
from .axis_state import ERROR, OK, SILENT, STALE, WARN, Alarm, AxisState, Status

LEVELS = ("ok", "warn", "error", "stale")
"""Words of the levels of a status, which are also the names of their styles."""


_NEWEST = 0.5
"""Age up to which a sample with its prediction counts as the newest [s]."""


def badge(level: int, word: str = "") -> str:
    """A coloured word."""
    return f"<span class='badge {LEVELS[level]}'>{escape(word or LEVELS[level])}</span>"


def state(axis: AxisState, noise: float | None) -> str:
    """Driver, phase under way, newest numbers.

    Parameters
    ----------
    axis : AxisState
        The axis that is shown.
    noise : float or None
        RMS noise of the sensor [m].
    """
    newest = axis.window.newest(_NEWEST if axis.is_streaming else 0.0)
    phase = escape(printable(axis.phase)) if axis.is_streaming else ""
    prediction = axis.part("prediction")
    rms = None if prediction is None or prediction.age > SILENT else axis.residual_rms
    numbers: list[tuple[str, str, str]] = [("phase", "phase", phase or "—")]
    if newest.size:
        predicted = np.flatnonzero(np.isfinite(newest.prediction))
        k = int(predicted[-1]) if predicted.size else newest.size - 1  # all numbers are those of one sample
        numbers += [
            ("voltage", "drive voltage", f"{newest.voltage[k]:.3f} V"),
            ("displacement", "displacement", _micrometre(newest.displacement[k])),
            ("prediction", "predicted", _micrometre(newest.prediction[k])),
            ("residual", "residual", length(newest.residual[k])),
        ]
    numbers += [
        ("residual_rms", "residual, RMS", length(rms)),
        ("noise", "sensor noise, RMS", length(noise)),
    ]
    cells = "".join(f"<div><dt>{label}</dt><dd id='{key}'>{text}</dd></div>" for key, label, text in numbers)
    return f"{_driver(axis)}<dl>{cells}</dl>"


def _driver(axis: AxisState) -> str:
    driver = axis.part("stage")
    if driver is None:
        return f"<p id='driver'>{badge(STALE, 'no driver')} no driver has reported yet</p>"
    if driver.age > SILENT:
        return f"<p id='driver'>{_gone('driver', driver)}</p>"
    claimed = driver.values.get("claimed_by", "")
    words = [escape(driver.message)]
    if claimed:
        words.append(f"claimed by {escape(claimed)}")
    if rate := driver.values.get("rate"):
        words.append(f"{_count(rate)} of {_count(driver.values.get('rate_expected', ''))} samples/s")
    if not axis.is_streaming:
        words.append("no samples arrive")
    return f"<p id='driver'>{badge(driver.level, 'driver')} {'; '.join(words)}</p>"


def _gone(node: str, newest: Status) -> str:
    return f"{badge(STALE, f'no {node}')} the {node} has been silent for {newest.age:.0f} s"


def alarms(axis: AxisState) -> str:
    """What is wrong at present, what was, and the change watch."""
    silent = [s for s in axis.statuses.values() if s.age > SILENT]
    rows = [_alarm_row(alarm) for alarm in axis.alarms if axis.statuses[alarm.name].age <= SILENT]
    rows += [table_row(badge(STALE, "silent"), escape(s.name), f"no report for {s.age:.0f} s") for s in silent]
    present = table_of(rows) if rows else f"<p>{badge(OK)} nothing is reported</p>"
    past = [_alarm_row(alarm) for alarm in axis.past_alarms]
    over = f"<details><summary>{len(past)} earlier</summary>{table_of(past)}</details>" if past else ""
    return f"<div id='alarms'>{present}{over}</div>{_change(axis.change)}"


def _alarm_row(alarm: Alarm) -> str:
    return table_row(badge(alarm.level), _clock(alarm.began), f"<b>{escape(alarm.name)}</b> {escape(alarm.message)}")


def _change(change: Status | None) -> str:
    if change is None:
        return "<h4>Change watch</h4><p>no report yet</p>"
    if change.age > SILENT:
        return f"<h4>Change watch</h4><p id='change'>{_gone('model node', change)}</p>"
    words = [f"{badge(change.level, 'change')} {escape(change.message)}"]
    values = change.values
    if "statistic" in values and change.level != STALE:
        words.append(f"statistic {_number(values['statistic']):.2g}, threshold 1")
    if "group" in values and change.level in (WARN, ERROR):
        size, low, high = (_amount(values, name) for name in ("change", "change_low", "change_high"))
        words.append(f"{escape(values['group'])}: {size} ({low} to {high})")
    if "recalibration" in values:
        words.append(f"recalibration: {escape(values['recalibration'])}")
    if "onset" in values:
        words.append(f"since {_clock(_number(values['onset']))}")
    return f"<h4>Change watch</h4><p id='change'>{'; '.join(words)}</p>"


def identification(axis: AxisState) -> str:
    """The job under way and the verdict of the last diagnosis."""
    status, reported = axis.identification, axis.part("identification")
    lines = []
    if reported is not None and reported.age > SILENT:
        lines.append(f"<p id='job'>{_gone('identification node', reported)}</p>")
    elif status is None:
        lines.append("<p>no identification node has reported yet</p>")
    else:
        values = status.values
        percent = min(max(_number(values.get("percent", "0")), 0.0), 100.0)
        word, phase = values.get("state", ""), values.get("phase", "")
        lines.append(f"<p id='job'>{badge(status.level, word)} {escape(phase)} {escape(status.message)}</p>")
        if 0.0 < percent < 100.0:
            lines.append(f"<div class='progress'><div style='width:{percent:.0f}%'></div></div>")
        if values.get("experiment") and values["experiment"] not in status.message:
            lines.append(f"<p class='path'>{escape(values['experiment'])}</p>")
    verdict = escape(axis.verdict) or "no diagnosis since the identification node was started"
    return f"{''.join(lines)}<h4>Verdict of the last diagnosis</h4><p id='verdict'>{verdict}</p>"


def model(axis: AxisState) -> str:
    """The model in use and the ones before it."""
    refused = f"<p>{badge(2, 'refused')} {escape(axis.refused_model)}</p>" if axis.refused_model else ""
    in_use = _in_use(axis)
    recalibrated = _recalibrations(axis)
    if axis.model is None:
        return f"{refused}{in_use}{recalibrated}"
    rows = []
    for entry in reversed(axis.models):
        chain = ", ".join(effect.name.replace("_", " ") for effect in entry.model.effects)
        date = entry.model.provenance.get("date", "")
        rows.append(
            f"<tr><td>{_clock(entry.received)}</td><td><code>{escape(_short(entry.hash))}</code></td>"
            f"<td>{length(entry.free_run_error)}</td><td>{escape(str(date))}</td><td>{escape(chain)}</td></tr>"
        )
    head = "<tr><th>received</th><th>model</th><th>free-run error</th><th>fitted</th><th>effects</th></tr>"
    table = f"<div class='table'><table>{head}{''.join(rows)}</table></div>"
    return f"{refused}{in_use}<h4>Models of the identification node</h4>{table}{recalibrated}"


def _recalibrations(axis: AxisState) -> str:
    """What the model node has fitted anew, the newest first."""
    if not axis.recalibrations:
        return ""
    head = (
        "<tr><th>recalibrated</th><th>group</th><th>number</th><th>old</th><th>new</th><th>95 % interval</th>"
        "<th>residual before</th><th>after</th></tr>"
    )
    rows = [
        table_row(
            escape(n.time.replace("T", " ").replace("Z", " UTC")),
            escape(n.group),
            escape(n.parameter),
            f"{n.old:.6g}",
            f"{n.new:.6g} {escape(n.unit)}",
            f"{n.low:.6g} to {n.high:.6g}",
            length(n.residual_before),
            length(n.residual_after),
        )
        for n in reversed(axis.recalibrations)
    ]
    return f"<h4>Recalibrations</h4><div id='recalibrations'>{table_of([head, *rows])}</div>"


def _in_use(axis: AxisState) -> str:
    prediction = axis.part("prediction")
    if prediction is None:
        return "<p>no model node has reported yet</p>"
    if prediction.age > SILENT:
        return f"<p id='model'>{_gone('model node', prediction)}</p>"
    used = prediction.values.get("model", "")
    if not used:
        return f"<p>{badge(prediction.level, 'prediction')} {escape(prediction.message)}</p>"
    error = axis.free_run_error
    promise = "" if error is None else f", free-run error {length(error)}"
    return (
        f"<p id='model'>{badge(prediction.level, 'prediction')} {escape(prediction.message)}; "
        f"in use: <code>{escape(_short(used))}</code>{promise}</p>"
    )


def _short(model_hash: str) -> str:
    return model_hash.removeprefix("sha256:")[:12]


def table_row(*cells: str) -> str:
    """One row of a table."""
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def table_of(rows: Iterable[str]) -> str:
    """A table that can be moved sideways where it is too wide."""
    return f"<div class='table'><table>{''.join(rows)}</table></div>"


def _clock(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "—"
    return datetime.fromtimestamp(seconds, UTC).strftime("%H:%M:%S UTC")


def _count(text: str) -> str:
    number = _number(text)
    return f"{number:,.0f}".replace(",", "\u202f") if math.isfinite(number) else "—"


def _amount(values: Mapping[str, str], name: str) -> str:
    """A change as people write it: without a unit as a percentage, a lag in microseconds, an offset in nanometres."""
    size, unit = _number(values.get(name, "")), values.get("unit", "")
    factor, word = {"1": (1e2, "%"), "s": (1e6, "µs"), "m": (1e9, "nm")}.get(unit, (1.0, escape(unit)))
    return f"{factor * size:.3g} {word}"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _micrometre(metres: float | None) -> str:
    return "—" if metres is None or not math.isfinite(metres) else f"{1e6 * metres:.4f} µm"


def length(metres: float | None) -> str:
    """A length in nanometres; a dash where there is none."""
    return "—" if metres is None or not math.isfinite(metres) else nanometre(metres)
