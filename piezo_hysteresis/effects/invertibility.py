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

"""`Invertibility`: whether an effect has an inverse, for `compensation`."""

from __future__ import annotations

from enum import StrEnum


class Invertibility(StrEnum):
    """Whether a wanted output of an effect can be turned into the input that gives it."""

    EXACT = "exact"
    """Exact up to rounding, wherever the wanted output is reachable."""
    APPROXIMATE = "approximate"
    """With an error that `Inverse` states."""
    NOT_NEEDED = "not needed"
    """The effect is not on the way from the drive to the displacement, and nobody knows its course beforehand."""
    IMPOSSIBLE = "impossible"
    """No inverse sample by sample is known."""
