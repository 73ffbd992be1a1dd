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

"""Tables of the data: the records, and the findings about them."""

from __future__ import annotations

import numpy as np

from ...channel_mapping import QUANTITIES, quantity_of
from ...record import Experiment, Record
from ...recording.checks.lag import lag_of
from ..words import duration
from .table import Table

_NOTE = (
    "Lag is the delay of the displacement at the turning points of the drive (in samples). It comes from the dynamics, "
    "from a held drive (up to one sample), from creep in slow drives, or from a delayed channel. Creep and asymmetry "
    "bend a slow loop, which then shows a lag or, with a minus sign, a lead of up to 1 % of the time between two "
    "turning points."
)
"""Explanation of the column of lags."""


def record_table(experiment: Experiment, noise: np.ndarray) -> Table:
    """Every record: period, length, ranges, noise.

    Parameters
    ----------
    experiment : Experiment
        The data.
    noise : (r,) ndarray
        Noise of every record [m].
    """
    rows = []
    for record, sigma in zip(experiment, noise, strict=True):
        start = "continues" if record.continues else f"from {record.settled_voltage:.3g} V"
        rows.append(
            (
                record.phase,
                f"{record.size}",
                duration(record.sample_period),
                duration(record.duration),
                f"{record.voltage.min():.3g} … {record.voltage.max():.3g}",
                f"{1e6 * record.displacement.min():.4g} … {1e6 * record.displacement.max():.4g}",
                f"{1e9 * sigma:.2g}" if record.size > 2 else "",  # two samples do not show it
                _lag(record),
                "truncated" if record.truncated else start,
            )
        )
    header = ("phase", "samples", "period", "length", "drive [V]", "displacement [µm]", "noise [nm]", "lag", "start")
    return Table("What was recorded", header, tuple(rows), _NOTE, frozenset(range(1, 8)))


def understood_table(experiment: Experiment) -> Table:
    """Every channel with its range over all phases, in the units of labels, and how many phases have it."""
    channels: dict[str, list[np.ndarray]] = {}
    for record in experiment:
        held = {"voltage": record.voltage, "displacement": record.displacement, **record.channels}
        for name, values in held.items():
            channels.setdefault(name, []).append(values)
    rows = []
    for name, parts in channels.items():
        quantity = quantity_of(name) or name
        factor, unit = (1e6, "µm") if quantity == "displacement" else (1.0, QUANTITIES[quantity])
        low, high = factor * min(p.min() for p in parts), factor * max(p.max() for p in parts)
        rows.append((name, f"{low:.4g} … {high:.4g} {unit}", f"{len(parts)} of {len(experiment)}"))
    note = "Wrong ranges mean a wrong column or unit: give --column and --unit."
    return Table("What was understood", ("channel", "range", "phases"), tuple(rows), note)


def _lag(record: Record) -> str:
    lag = lag_of(record)
    if lag is None:
        return ""
    return f"{'-' if lag.time < 0 else ''}{duration(abs(lag.time))} ({lag.time / record.sample_period:.2g})"


def notice_table(experiment: Experiment) -> Table | None:
    """Findings about the data, the severe ones first."""
    if not experiment.notices:
        return None
    ordered = sorted(experiment.notices, key=lambda n: not n.severe)
    return Table(
        "What was noticed",
        ("kind", "phase", "finding", "weight"),
        tuple((n.kind, n.phase or "all", n.message, "severe" if n.severe else "minor") for n in ordered),
    )
