"""The packages of the extra `fleet`, which the rest of the package does without."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import RecordingError


def package(name: str) -> Any:
    """A module of the extra, or of a package that it brings.

    Parameters
    ----------
    name : str
        Of the module, e.g. ``"pyarrow.parquet"``.

    Raises
    ------
    RecordingError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        owner = name.partition(".")[0]
        raise RecordingError(
            f"fleet: got no Python package '{owner}', expected the extra 'fleet'; "
            "run: pip install 'piezo_hysteresis[fleet]'"
        ) from None
