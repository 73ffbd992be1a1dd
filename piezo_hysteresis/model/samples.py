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

"""Checks of the samples for a model: one dimension, at least one sample, all finite."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..channel_mapping import ChannelMapping, are_finite, channel_samples
from ..errors import ModelError

Array = NDArray[np.float64]


def row(values: ArrayLike, name: str) -> Array:
    """As float64, shape (n,); without a copy where the values have this type already.

    Raises
    ------
    ModelError
        On another shape, no sample, or what is not a real number.
    """
    try:
        array = np.asarray(values)
        array = array.astype(np.float64, casting="same_kind", copy=False)
    except (TypeError, ValueError):
        raise ModelError(f"{name}: got {type(values).__name__}, expected one dimension of real numbers") from None
    if array.ndim != 1 or array.size == 0:
        raise ModelError(f"{name}: got shape {array.shape}, expected one dimension with at least one sample")
    return array


def samples(values: ArrayLike, name: str) -> Array:
    """As `row`; ModelError also on a sample that is not finite."""
    array = row(values, name)
    if not are_finite(array):
        raise not_finite(name, array)
    return array


def channels_of(given: Mapping[str, ArrayLike], size: int) -> ChannelMapping:
    """The channels of a block of `size` samples, checked as those of a record.

    Raises
    ------
    RecordError
        On an unknown name, another length, or samples that are not finite.
    """
    return ChannelMapping({name: channel_samples(name, values, size) for name, values in given.items()})


def not_finite(name: str, values: Array, first: int = 0) -> ModelError:
    """The error about samples that are not all finite; `first` is the number of the first sample."""
    return ModelError(f"{name}: sample {first + int((~np.isfinite(values)).argmax())} is not finite")
