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

"""Header of a PI GCS array: the same in the answer of a controller and in a saved file."""

from __future__ import annotations

from collections.abc import Iterable

END = "END_HEADER"
"""Last line of the header, without its number sign."""


def gcs_header(lines: Iterable[str]) -> tuple[dict[str, str], int] | None:
    """Keys of the lines ``# KEY = value``, in capitals, and the number of lines; None if the header does not end.

    Examples
    --------
    >>> gcs_header(["# DIM = 2", "# SEPARATOR = 9", "# END_HEADER", "0 1"])
    ({'DIM': '2', 'SEPARATOR': '9'}, 3)
    """
    keys: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        words = line.lstrip("# ").strip()
        if words == END:
            return keys, number
        key, equals, value = words.partition("=")
        if equals:
            keys[key.strip().upper()] = value.strip()
    return None


def gcs_separator(keys: dict[str, str]) -> str | None:
    """The character between the numbers of a row; None for white space and for codes of invisible characters.

    Examples
    --------
    >>> gcs_separator({"SEPARATOR": "59"}), gcs_separator({"SEPARATOR": "9"}), gcs_separator({})
    (';', None, None)
    """
    code = keys.get("SEPARATOR", "32")
    visible = code.isascii() and code.isdecimal() and len(code) <= 3 and 32 < int(code) < 127
    return chr(int(code)) if visible else None
