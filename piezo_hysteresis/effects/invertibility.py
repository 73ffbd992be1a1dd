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
    """Whether the input that gives a wanted output of an effect can be computed."""

    EXACT = "exact"
    """Exact up to rounding, if the wanted output is reachable."""
    APPROXIMATE = "approximate"
    """With an error, which `compensation.Inverse` reports."""
    NOT_NEEDED = "not needed"
    """The effect does not depend on the drive and cannot be predicted."""
    IMPOSSIBLE = "impossible"
    """No sample-by-sample inverse is known."""
