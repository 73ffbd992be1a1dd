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

"""The voltages and displacements of several axes in a record, in the order of their numbers."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..channel_mapping import axes_of
from ..record import Record


def names(record: Record, quantity: str) -> tuple[str, ...]:
    """Channels of one quantity, the first axis first.

    Parameters
    ----------
    record : Record
        With ``voltage_2``, ``displacement_2``, … in its channels.
    quantity : str
        ``"voltage"`` or ``"displacement"``.

    Examples
    --------
    >>> r = Record([0.0], [0.0], 1.0, channels={"voltage_2": [1.0], "displacement_3": [0.0], "monitor_voltage": [0.0]})
    >>> names(r, "voltage"), names(r, "displacement")
    (('voltage', 'voltage_2'), ('displacement', 'displacement_3'))
    """
    return axes_of(record.channels, quantity)


def columns(record: Record, quantity: str) -> NDArray[np.float64]:
    """Samples of all axes, shape (n, axes) [V or m]."""
    held = {"voltage": record.voltage, "displacement": record.displacement, **record.channels}
    return np.column_stack([held[name] for name in names(record, quantity)])


def has_several_axes(records: Iterable[Record]) -> bool:
    """Whether any record holds more than one drive voltage, or more than one displacement."""
    return any(len(names(record, quantity)) > 1 for record in records for quantity in ("voltage", "displacement"))
