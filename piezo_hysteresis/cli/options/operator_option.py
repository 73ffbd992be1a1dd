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

"""Option for the hysteresis operator that is identified."""

from __future__ import annotations

import argparse

from ...effects import HYSTERESIS, OPERATORS


def add_operator(parser: argparse._ActionsContainer) -> None:
    """Declare ``--hysteresis``."""
    parser.add_argument(
        "--hysteresis",
        metavar="NAME",
        choices=OPERATORS,
        default=HYSTERESIS.name,
        help=f"hysteresis operator to identify: {', '.join(OPERATORS)} (default: {HYSTERESIS.name})",
    )
