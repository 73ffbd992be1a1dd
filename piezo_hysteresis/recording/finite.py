"""Records from channels that may have holes: split at every hole, told, never interpolated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordError
from ..record import Notice, Record, Samples

SHORTEST_SHARE = 1 / 64
"""A piece between two holes is kept when it is at least this share of the phase."""


def stretches(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop of every run of True.

    >>> stretches(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(good.astype(np.int8), prepend=0, append=0))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def finite_records(
    voltage: Samples,
    displacement: Samples,
    sample_period: float,
    extra: Mapping[str, Samples] | None = None,
    **labels: Any,
) -> tuple[tuple[Record, ...], tuple[Notice, ...]]:
    """One phase as records without its non-finite samples.

    Parameters
    ----------
    voltage, displacement : (n,) ndarray
        Drive [V] and answer [m], with NaN or infinity where nothing was measured.
    sample_period : float
        Time between samples [s].
    extra : mapping of str to (n,) ndarray, optional
        `other_displacement` [m] and `temperature` [K]; left out where they have holes.
    **labels
        The other fields of `Record`.

    Returns
    -------
    records : tuple of Record
        A record behind a hole `continues` and is `truncated`: its state can be carried, but not exactly.
    notices : tuple of Notice
        What was dropped.

    Raises
    ------
    RecordError
        On unequal channels or where no finite sample is left.
    """
    phase = str(labels.get("phase", "record"))
    notices = []
    kept: dict[str, Any] = {}
    for name, values in (extra or {}).items():
        if np.isfinite(values).all():
            kept[name] = values
        else:
            notices.append(Notice("non_finite", f"{name} has non-finite samples: the channel is left out", phase))
    if voltage.ndim != 1 or voltage.shape != displacement.shape or voltage.size == 0:
        # Record says precisely what is wrong with the shapes
        return (Record(voltage, displacement, sample_period, **labels),), tuple(notices)
    good = np.isfinite(voltage) & np.isfinite(displacement)
    if good.all():
        return (Record(voltage, displacement, sample_period, **kept, **labels),), tuple(notices)
    runs = stretches(good)
    if not runs:
        raise RecordError(f"phase '{phase}': got no finite sample among {good.size}")
    shortest = min(SHORTEST_SHARE * good.size, max(b - a for a, b in runs))
    runs = [(a, b) for a, b in runs if b - a >= shortest]
    lost = good.size - sum(b - a for a, b in runs)
    notices.append(
        Notice(
            "non_finite",
            f"{int(np.count_nonzero(~good))} of {good.size} samples are not finite: {lost} dropped, "
            f"the phase is split into {len(runs)}",
            phase,
            severe=lost > good.size // 2,
        )
    )
    start_time = float(labels.pop("start_time", 0.0))
    records = []
    for a, b in runs:
        if a > 0:
            labels |= {"continues": True, "truncated": True, "initial_voltage": None}
        part = {name: values[a:b] for name, values in kept.items()} | labels
        start = start_time + a * sample_period
        records.append(Record(voltage[a:b], displacement[a:b], sample_period, start_time=start, **part))
    return tuple(records), tuple(notices)
