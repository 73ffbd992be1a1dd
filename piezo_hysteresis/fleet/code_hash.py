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

"""`code_hash`: hash of the code that computes results."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOMS = (
    "blocks", "changes", "channel_mapping.py", "discrepancy", "effects", "errors.py", "fleet/work.py",
    "fleet/work_result.py", "gcs_header.py", "identification", "inverse_terms.py", "model", "notice.py", "online",
    "parameter.py", "point_cloud.py", "record.py", "recording", "report/words.py", "turning_points.py", "yaml_file.py",
)  # fmt: skip
"""Modules on which a result depends."""
LIBRARIES = ("numba", "numpy", "scipy")
"""Packages whose version can change a result."""


@cache
def code_hash() -> str:
    """Hash of the source files in `ROOMS` and of the versions of `LIBRARIES`: ``sha256:`` and 16 digits."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for room in ROOMS:
        place = package / room
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"{file.relative_to(package).as_posix()}\n".encode())
            digest.update(file.read_bytes())
    for library in LIBRARIES:
        try:
            digest.update(f"{library} {version(library)}\n".encode())
        except PackageNotFoundError:
            digest.update(f"{library}\n".encode())
    return "sha256:" + digest.hexdigest()[:16]
