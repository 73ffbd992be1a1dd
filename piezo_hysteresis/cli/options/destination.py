"""Where results go: nothing that exists is replaced without a word, and that is found out before the work."""

from __future__ import annotations

from pathlib import Path

from ...errors import RecordingError


def require_new_file(option: str, path: str | None) -> None:
    """Refuse a file that exists.

    Parameters
    ----------
    option : str
        What the user typed before it, e.g. ``"--truth"``.
    path : str or None
        The file; None where none was asked for.

    Raises
    ------
    RecordingError
        If it exists, or its folder does not.
    """
    if path is None:
        return
    place = Path(path).expanduser()
    if place.exists():
        raise RecordingError(f"{option}: {place} exists already, expected a new file; choose another name or remove it")
    if not place.absolute().parent.is_dir():
        raise RecordingError(f"{option}: {place.parent} is no folder, expected one that exists; create it")


def require_new_experiment(option: str, path: str) -> None:
    """Refuse a place where an experiment cannot be written because something is there.

    Parameters
    ----------
    option : str
        What the user typed before it, e.g. ``"-o"``.
    path : str
        As for `recording.write`: a folder, or a file ending .csv, .mat or .mcap.

    Raises
    ------
    RecordingError
        If it exists and is no empty folder.
    """
    place = Path(path).expanduser()
    place = place.with_suffix("") if place.suffix == ".mcap" else place
    empty = place.is_dir() and place.suffix not in (".csv", ".mat") and not any(place.iterdir())
    if (place.exists() or place.is_symlink()) and not empty:
        raise RecordingError(f"{option}: {place} exists already, expected a new name; choose another one or remove it")
