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

"""Answers in the form of GCS 2.0: the lines of one answer, which the server joins by a space and a line feed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...stage.description import Samples


def number(value: float) -> str:
    """A number as text with nine digits, so that a number of single precision is read back exactly."""
    return f"{value:.9g}"


def items(values: Mapping[object, object]) -> list[str]:
    """Lines ``item=value``."""
    return [f"{item}={number(value) if isinstance(value, float) else value}" for item, value in values.items()]


def array(values: Samples, sample_time: float, names: Sequence[str]) -> list[str]:
    """A GCS array: header, then one line per row of `values`, shape (rows, columns)."""
    header = [
        "# REM emulated",
        "# VERSION = 1",
        "# TYPE = 1",
        "# SEPARATOR = 32",
        f"# DIM = {values.shape[1]}",
        f"# SAMPLE_TIME = {number(sample_time)}",
        f"# NDATA = {values.shape[0]}",
        *(f"# NAME{i} = {name}" for i, name in enumerate(names)),
        "#",
        "# END_HEADER",
    ]
    return header + [" ".join(map(number, row)) for row in values.tolist()]
