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

"""`decimation`: the phases of a bag that are averaged on reading; the node records them at the full rate."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import yaml

from ...errors import RecordingError
from ...yaml_file import read_yaml

FILE = "decimate.yaml"
"""Name of the file in the folder of the bag."""


def save_decimation(folder: Path, phases: Iterable[tuple[str, int]]) -> None:
    """Write phase names and the numbers of samples that are averaged into one (`Record.decimate`).

    Of several phases with one name the smallest number counts, so that none is averaged more than planned.
    """
    factors: dict[str, int] = {}
    for name, number in phases:
        factors[name] = min(number, factors.get(name, number))
    text = "# Samples averaged into one on reading, by phase.\n" + yaml.safe_dump(factors)
    try:
        (folder / FILE).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{folder / FILE}: {error.strerror or error}") from None


def load_decimation(folder: Path) -> dict[str, int]:
    """Phase names and factors of a bag; empty where nothing is to be averaged.

    Raises
    ------
    RecordingError
        If the file is there but does not map names to whole numbers.
    """
    if not (folder / FILE).exists():
        return {}
    try:
        factors = read_yaml(folder / FILE)
    except RecordingError as error:
        raise RecordingError(f"{error}; expected phase names and whole numbers") from None
    whole = isinstance(factors, dict) and all(type(n) is int and n >= 1 for n in factors.values())
    if not whole:
        raise RecordingError(f"{folder / FILE}: got something else, expected phase names and whole numbers")
    return {str(name): number for name, number in factors.items()}
