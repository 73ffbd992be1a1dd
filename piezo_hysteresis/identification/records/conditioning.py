"""`carried`: a selection of records together with those that bring the stage into its state."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...record import Record


def carried(records: Sequence[Record], wanted: Collection[int]) -> list[int]:
    """Indices of the records `wanted`, and of those before them that they continue, in order."""
    needed: set[int] = set()
    for index in wanted:
        needed.add(index)
        while records[index].continues and index > 0:
            index -= 1
            needed.add(index)
    return sorted(needed)


def select(
    records: Sequence[Record], floors: Sequence[float], wanted: Collection[int]
) -> tuple[list[Record], list[float]]:
    """Records for a fit to some of them, and their floors: infinite, hence without weight, where one only carries.

    Parameters
    ----------
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of the residual of every record [m].
    wanted : collection of int
        Indices of the records to fit.
    """
    kept = carried(records, wanted)
    return [records[i] for i in kept], [floors[i] if i in wanted else np.inf for i in kept]
