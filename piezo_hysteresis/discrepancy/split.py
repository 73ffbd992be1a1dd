"""Which records report the gap: they are used neither for fitting nor for choosing an effect."""

from __future__ import annotations

from collections.abc import Sequence

from ..record import Record

SHARE = 3
"""One record of so many of a kind reports."""


def reporting(records: Sequence[Record]) -> tuple[int, ...]:
    """Indices of the records set aside for the report.

    From every kind of phase of which there are at least three realisations one in three, from the middle of its list, so
    that the extremes of amplitude and frequency stay in the fit. A record that another one continues is never taken.
    """
    kinds: dict[str, list[int]] = {}
    for index, record in enumerate(records):
        kinds.setdefault(record.phase.split("_")[0], []).append(index)
    carried = {i for i in range(len(records)) if i + 1 < len(records) and records[i + 1].continues}
    chosen = [
        index
        for members in kinds.values()
        for index in members[SHARE // 2 :: SHARE][: len(members) // SHARE]
        if index not in carried and not records[index].continues
    ]
    return tuple(sorted(chosen))
