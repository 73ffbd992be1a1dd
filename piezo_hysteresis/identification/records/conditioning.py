"""`with_conditioning`: selected records, together with the records before them that determine the initial state."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...record import Record


def with_conditioning(records: Sequence[Record], wanted: Collection[int]) -> list[int]:
    """Indices of the records `wanted`, and of the records before them that they continue; in order."""
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
    """Records for a fit, and their noise floors.

    A record that only determines the state of the next one has an infinite floor, hence no weight.

    Parameters
    ----------
    records : sequence of Record
        All records of the experiment, in order.
    floors : sequence of float
        Noise floor of every record [m].
    wanted : collection of int
        Indices of the records to fit.
    """
    kept = with_conditioning(records, wanted)
    return [records[i] for i in kept], [floors[i] if i in wanted else np.inf for i in kept]
