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

"""`TdmsArrays`: the channels of a LabVIEW file, read through npTDMS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import DecimatingBuffer
from ..table.read_options import ReadOptions
from .named_arrays import NamedArrays

_BRACKETS = str.maketrans("[]", "()")
"""Replacement for brackets, which denote the column of a matrix."""


def _numbers(values: NDArray[Any], channel: Any) -> NDArray[Any]:
    """Numbers of a part of a channel: of dates, the time since its first one [s]."""
    if values.dtype.kind != "M":
        return np.asarray(values)
    return np.asarray((values - channel[0]) / np.timedelta64(1, "s"))


class TdmsArrays(NamedArrays):
    """``"group.channel (unit)"`` to array, and ``"dt"``, the increment of the waveforms [s].

    Parameters
    ----------
    path : Path
        The file, open while this is used as a context manager.

    Raises
    ------
    RecordingError
        If npTDMS is not installed, or a channel declares more numbers than the file has bytes.
    """

    kind = "the channels"

    def __init__(self, path: Path) -> None:
        try:
            from nptdms import TdmsFile
        except ImportError:
            raise RecordingError(
                "is a LabVIEW TDMS file, for which npTDMS is needed: pip install npTDMS; or export it as text"
            ) from None
        self._size = path.stat().st_size
        self._raw = path.open("rb")
        try:
            self._list(TdmsFile.open(self._raw))
        except BaseException:
            self.close()
            raise

    def _list(self, file: Any) -> None:
        self._channels: dict[str, Any] = {}
        self._increments: set[float] = set()
        for group in file.groups():
            for channel in group.channels():
                if len(channel) > self._size:
                    raise RecordingError(f"{channel.name}: declares {len(channel)} numbers, more than the file holds")
                unit = str(channel.properties.get("unit_string", "")).strip("[] ")
                name = f"{group.name}.{channel.name}" + (f" ({unit})" if unit else "")
                self._channels[name.translate(_BRACKETS)] = channel
                self._increments |= {float(channel.properties.get("wf_increment", 0.0))} - {0.0}

    def close(self) -> None:
        self._raw.close()

    def __iter__(self) -> Iterator[str]:
        yield from self._channels
        if len(self._increments) == 1:
            yield "dt"

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name == "dt":
            return np.array(list(self._increments))
        return np.asarray(self._channels[name][:])

    def shape(self, name: str) -> tuple[int, ...]:
        return (len(self._increments if name == "dt" else self._channels[name]),)

    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        channel = self._channels[name]
        self.check_column(name, column)
        return self.in_pieces(name, len(channel), options, lambda part: _numbers(channel[part], channel))
