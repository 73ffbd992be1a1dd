"""`code_hash`: tells whether results were computed by the same code."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOMS = (
    "blocks", "channel_mapping.py", "discrepancy", "effects", "fleet/work.py", "fleet/work_result.py", "identification",
    "model", "notice.py", "online", "parameter.py", "record.py", "recording", "report/words.py",
)  # fmt: skip
"""What a result depends on: the rooms that read, model and fit, and what is taken from their answers."""
LIBRARIES = ("numba", "numpy", "scipy")
"""Packages whose version may change a result."""


@cache
def code_hash() -> str:
    """``sha256:`` and 16 digits of the sources that a result depends on, and of the versions of numerical packages."""
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
