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

"""`Notice`: one finding about the quality of data."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import printable


@dataclass(frozen=True, slots=True)
class Notice:
    """One finding about the quality of data. It is reported; the data are never changed silently.

    Parameters
    ----------
    kind : str
        Stable word: ``gap``, ``clipped``, ``non_finite``, ``duplicate``, ``not_at_rest``, ``units``, …
    message : str
        One printable line.
    phase : str
        Phase in which it was found; empty for the whole experiment.
    severe : bool
        True if no verdict should be based on the data.
    """

    kind: str
    message: str
    phase: str = ""
    severe: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", printable(self.message))
