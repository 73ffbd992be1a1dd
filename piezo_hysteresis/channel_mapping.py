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

"""Channels in addition to voltage and displacement: names, axes and units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.blas import ddot  # numpy's would warn of squares that are too large

from .errors import RecordError

Samples = NDArray[np.float64]

QUANTITIES: Mapping[str, str] = {"voltage": "V", "displacement": "m", "temperature": "K"}
"""SI unit of every quantity that a channel can contain."""

_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
"""Valid channel names: words of lower-case letters and digits."""
_AXIS = re.compile(r"(voltage|displacement)_(\d{1,6})")
"""Channel of a further axis."""


def are_finite(samples: Samples) -> bool:
    """Whether all samples are finite. The sum of squares is a fast test; if it overflows, every sample is tested."""
    return math.isfinite(ddot(samples, samples)) or bool(np.isfinite(samples).all())


def channel_samples(name: str, values: ArrayLike, length: int | None) -> Samples:
    """Samples of one channel as an array that cannot be changed, shape (n,).

    Parameters
    ----------
    name : str
        Name of the channel, for error messages.
    values : (n,) array_like
        Samples of the channel.
    length : int or None
        Number of samples of the channels before it; None for the first one.

    Raises
    ------
    RecordError
        If they are not numbers, are empty, have another length, or are not finite.
    """
    try:
        samples = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise RecordError(f"{name}: got {type(values).__name__}, expected an array of numbers") from None
    if samples.ndim != 1 or samples.size == 0:
        raise RecordError(f"{name}: got shape {samples.shape}, expected one dimension with at least one sample")
    if length is not None and samples.size != length:
        raise RecordError(f"{name}: got {samples.size} samples, expected {length} as in voltage")
    if not are_finite(samples):
        bad = ~np.isfinite(samples)
        raise RecordError(
            f"{name}: sample {int(bad.argmax())} is {samples[bad.argmax()]}, expected finite values; "
            f"drop or split the record at its {int(bad.sum())} non-finite samples"
        )
    samples.setflags(write=False)
    return samples


def quantity_of(name: str) -> str | None:
    """The quantity that a channel name contains as a word; None if it contains none, or two.

    Examples
    --------
    >>> quantity_of("other_displacement"), quantity_of("monitor_voltage"), quantity_of("displacement_3")
    ('displacement', 'voltage', 'displacement')
    >>> quantity_of("initial_voltage_of_temperature"), quantity_of("phase")
    (None, None)
    """
    if _NAME.fullmatch(name) is None or name == "initial_voltage":  # that one is a number, not a channel
        return None
    words = [word for word in name.split("_") if word in QUANTITIES]
    return words[0] if len(words) == 1 else None


def axis_of(name: str) -> tuple[str, int] | None:
    """Quantity and number of a channel of a further axis; None for other names.

    Examples
    --------
    >>> axis_of("voltage_2"), axis_of("voltage"), axis_of("monitor_voltage")
    (('voltage', 2), None, None)
    """
    match = _AXIS.fullmatch(name)
    return None if match is None else (match[1], int(match[2]))


def axes_of(channels: Iterable[str], quantity: str) -> tuple[str, ...]:
    """Names of all channels of one quantity, the first axis first, from those besides ``voltage`` and ``displacement``.

    Examples
    --------
    >>> axes_of(["voltage_10", "voltage_2", "displacement_2", "temperature"], "voltage")
    ('voltage', 'voltage_2', 'voltage_10')
    """
    found = [(axis[1], name) for name in channels if (axis := axis_of(name)) and axis[0] == quantity]
    return (quantity, *(name for _, name in sorted(found)))


class ChannelMapping(Mapping[str, Samples]):
    """Frozen mapping of channel name to samples, for channels other than voltage and displacement.

    Parameters
    ----------
    channels : mapping of str to (n,) ndarray
        A name contains one of `QUANTITIES` as a word, which defines its unit: ``other_displacement`` [m],
        ``displacement_3`` [m], ``monitor_voltage`` [V], ``temperature`` [K].

    Raises
    ------
    RecordError
        If a name contains no quantity, or the record already has it.
    """

    __slots__ = ("_held",)

    def __init__(self, channels: Mapping[str, Samples] | None = None) -> None:
        self._held = dict(channels or {})
        for name in self._held:
            if name in ("voltage", "displacement") or quantity_of(name) is None:
                raise RecordError(
                    f"channels: got the name '{name}', expected one that holds one of {', '.join(QUANTITIES)} "
                    "as a word, e.g. displacement_2"
                )

    def __getitem__(self, name: str) -> Samples:
        return self._held[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._held)

    def __len__(self) -> int:
        return len(self._held)

    def __repr__(self) -> str:
        return f"ChannelMapping({', '.join(self._held)})"
