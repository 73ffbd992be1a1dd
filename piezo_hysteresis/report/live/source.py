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

"""`LiveSource`: interface between a page and the nodes: the known axes and their services."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from .axis_state import AxisState


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of a service.

    Parameters
    ----------
    success : bool
        Whether the request was done or begun.
    message : str
        Message of the service.
    """

    success: bool
    message: str


class LiveSource(Protocol):
    """Axes by name, and their services."""

    def axes(self) -> Mapping[str, AxisState]:
        """The axes known so far, by name."""

    def call(self, axis: str, service: str) -> Future[Answer]:
        """Call a service of an axis. The future always gets an answer, also where the service does not exist."""
