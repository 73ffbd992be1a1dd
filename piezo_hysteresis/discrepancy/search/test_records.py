"""Which records report the gap: they are used neither for fitting nor for choosing an effect."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ...record import Record

SHARE = 3
"""One record of so many of a kind reports."""


def reporting(records: Sequence[Record], usable: Collection[int]) -> tuple[int, ...]:
    """Indices of the records set aside for the report.

    Of every kind of phase with at least three realisations one in three, from the middle of its list, so that the
    extremes of amplitude and frequency stay in the fit; of a kind named ``validation`` all.

    Parameters
    ----------
    records : sequence of Record
        The experiment.
    usable : collection of int
        Indices that may be taken.
    """
    kinds: dict[str, list[int]] = {}
    for index in usable:
        kinds.setdefault(records[index].phase.split("_")[0], []).append(index)
    validation = kinds.pop("validation", [])
    if len(validation) == len(usable):
        return ()
    chosen = [i for members in kinds.values() for i in members[SHARE // 2 :: SHARE][: len(members) // SHARE]]
    return tuple(sorted(chosen + validation))
