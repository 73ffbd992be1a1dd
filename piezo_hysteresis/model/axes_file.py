"""`axes_file`: an `AxesModel` as an NPZ file; a file of parameters would hold some ten thousand lines."""

from __future__ import annotations

import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from ..errors import ModelError
from .axes_model import AxesModel

_NAMES = tuple(f.name for f in fields(AxesModel) if f.init)
"""Keys of the file."""


def save(model: AxesModel, path: str | Path) -> Path:
    """Write a model file, whole or not at all; returns its path.

    Raises
    ------
    ModelError
        If the name does not end in ``.npz`` or the file cannot be written.
    """
    path = Path(path).expanduser()
    if path.suffix != ".npz":
        raise ModelError(f"{path}: a model of several axes is an NPZ file; give it a name that ends in .npz")
    draft = path.with_name(path.stem + ".tmp.npz")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(draft, **{name: getattr(model, name) for name in _NAMES})
        draft.replace(path)
    except OSError as error:
        raise ModelError(f"{path}: cannot write the model file: {error}") from None
    return path


def load(path: str | Path) -> AxesModel:
    """Read a model file; reads back bit for bit.

    Raises
    ------
    ModelError
        If there is no such file, or it is no model of several axes.
    """
    path = Path(path).expanduser()
    try:
        with np.load(path, allow_pickle=False) as file:
            values = {name: file[name] for name in _NAMES}
        period, reference, memory = (float(values[name]) for name in ("sample_period", "reference", "memory"))
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile) as error:
        raise ModelError(f"{path}: expected a model of several axes, as `piezo identify` writes it: {error}") from None
    return AxesModel(values["taps"], values["elongation"], values["radii"], values["zero"], period, reference, memory)
