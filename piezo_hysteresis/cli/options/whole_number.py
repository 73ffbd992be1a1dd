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

"""`whole_number`: type of options that count, and of seeds."""

from __future__ import annotations

import argparse


def whole_number(text: str) -> int:
    """A whole number from 0 on, of at most 18 digits.

    Raises
    ------
    argparse.ArgumentTypeError
        On any other text.
    """
    if not (text.isascii() and text.isdecimal() and len(text) <= 18):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number from 0 to 1e18 - 1")
    return int(text)
