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

"""A plan as table, notes and JSON: terminal, page and JSON show the same numbers."""

from __future__ import annotations

from typing import Any

from ...compensation.plan import Plan
from ...errors import counted
from ...parameter import slew_text
from ..words import nanometre
from .table import Table

MOST_PARTS = 3
"""Largest number of unreachable parts that are listed."""


def plan_table(found: Plan) -> Table:
    """Voltage, slew, duration, preview and the expected errors."""
    expected, span = found.expected, found.range

    def error(value: float | None) -> str:
        if value is None:
            return "not stated"
        return nanometre(value) + (f", {100.0 * value / span:.3g} % of the path's range" if span else "")

    way_back = found.voltage.size - found.begin - found.wanted.size
    rows = (
        ("drive voltage", f"{found.voltage.min():.4g} to {found.voltage.max():.4g} V"),
        ("largest slew", slew_text(found.largest_slew, 4)),
        ("duration", f"{found.voltage.size * found.sample_period:.4g} s, {counted(found.voltage.size, 'sample')}"),
        ("way back to the first voltage", f"{1e3 * way_back * found.sample_period:.4g} ms"),
        ("preview", f"{counted(found.preview, 'sample')}, {1e3 * found.preview * found.sample_period:.3g} ms"),
        ("planned error", error(expected.planned)),
        ("free-run error of the model", error(expected.free_run)),
        ("uncertainty of the parameters on this path", error(expected.parameters)),
        ("expected error, rms", error(expected.total)),
    )
    return Table("Plan", ("quantity", "value"), rows)


def notes(found: Plan) -> list[str]:
    """Notes on the plan: its start, where it leaves what the model was identified on, and what it cannot reach."""
    lines = []
    if found.after_drive > found.expected.total:
        lines.append(
            "caution: the stage begins in the state at rest of the model; if it was driven over its range before, the "
            f"displacement along the path differs by {nanometre(found.after_drive)} rms, apart from a constant. "
            "Identify the model and play the path after the same conditioning"
        )
    lines += [f"caution: {said}; the error may be larger there" for said in found.beyond]
    lines += [
        f"caution: {name} has no inverse and was left out; the error above includes the effect of this"
        for name in found.left_out
    ]
    lines += [f"note: {name} does not depend on the drive and is not compensated" for name in found.not_on_path]
    return [*lines, *(f"caution: {line}" for line in refusal(found))]


def refusal(found: Plan) -> list[str]:
    """The unreachable parts, and the nearest reachable path; empty if the whole path is reachable."""
    parts = found.reachability.parts
    lines = [str(part) for part in parts[:MOST_PARTS]]
    if len(parts) > MOST_PARTS:
        more = len(parts) - MOST_PARTS
        lines.append(f"{more} more part{'s' * (more > 1)} of the path cannot be reached")
    nearest = found.reachability.nearest
    if nearest is None:
        return lines
    conditions = nearest.conditions()
    return [
        *lines,
        f"the whole path can be reached {conditions}" if conditions else "no change makes the path reachable",
    ]


def answer(found: Plan) -> dict[str, Any]:
    """The plan for the JSON file, in SI units."""
    nearest = found.reachability.nearest
    return {
        "schema": 1,
        "samples": int(found.voltage.size),
        "sample_period_s": found.sample_period,
        "preview_samples": found.preview,
        "preview_s": found.preview * found.sample_period,
        "path_begins_at_sample": found.begin,
        "range_m": found.range,
        "voltage_min_V": float(found.voltage.min()),
        "voltage_max_V": float(found.voltage.max()),
        "largest_slew_V_per_s": found.largest_slew,
        "expected_error": dict(found.expected.as_dict()),
        "after_drive_m": found.after_drive,
        "beyond_model": list(found.beyond),
        "reachable": found.reachability.is_whole,
        "unreachable": [
            {
                "begin_s": p.begin,
                "end_s": p.end,
                "largest_m": p.largest,
                "limit": p.limit,
                "other_limits": list(p.other_limits),
                "needed_min_V": p.needed_min,
                "needed_max_V": p.needed_max,
                "needed_slew_V_per_s": p.needed_slew,
                "after_loop": p.after_loop,
            }
            for p in found.reachability.parts
        ],
        "nearest": None
        if nearest is None
        else {"offset_m": nearest.offset, "amplitude": nearest.amplitude, "band_hz": nearest.band},
        "left_out": list(found.left_out),
        "not_on_path": list(found.not_on_path),
    }
