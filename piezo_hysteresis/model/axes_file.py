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

"""`axes_file`: an `AxesModel` as an NPZ file; a file of parameters would hold some ten thousand lines."""

from __future__ import annotations

import hashlib
import io
import lzma
import tokenize
import zipfile
import zlib
from dataclasses import fields
from pathlib import Path

import numpy as np

from ..errors import ModelError, RecordingError
from ..home_path import in_home
from ..yaml_file import read_regular_file
from .axes_model import AxesModel

_LARGEST = 1 << 30
"""Largest size of a model file [bytes]."""
_NAMES = tuple(f.name for f in fields(AxesModel) if f.init)
"""Keys of the file."""

_NUMBERS = ("sample_period", "reference", "memory", "level_max")
"""Keys with one number."""

_DAMAGED = (
    ValueError, TypeError, EOFError, MemoryError, NotImplementedError, RuntimeError, lzma.LZMAError,
    tokenize.TokenError, zlib.error,
)  # fmt: skip
"""Exceptions of a reader of NPZ files on damaged ones."""

_OPTIONAL = ("level_max", "free_run_error")
"""Keys that files of earlier versions do not have."""


def save(model: AxesModel, path: str | Path) -> Path:
    """Write a model file, which appears only when it is complete; returns its path.

    Raises
    ------
    ModelError
        If the name does not end in ``.npz`` or the file cannot be written.
    """
    path = in_home(path)
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
    """Read a model file. Every number is the one that was saved, bit for bit.

    Raises
    ------
    ModelError
        If there is no such file, or it is not a model of several axes.
    """
    path = in_home(path)
    expected = "expected a model of several axes, as piezo identify writes it"
    try:
        raw = io.BytesIO(read_regular_file(path, _LARGEST))
        with zipfile.ZipFile(raw):  # np.load takes other files for pickled objects
            pass
        with np.load(raw, allow_pickle=False) as file:
            if missing := [name for name in _NAMES if name not in file and name not in _OPTIONAL]:
                raise ModelError(f"got an NPZ file without '{missing[0]}', {expected}")
            values = {name: file[name] for name in _NAMES if name in file}
        model = AxesModel(**values | {name: float(value) for name, value in values.items() if name in _NUMBERS})
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}, {expected}") from None
    except RecordingError as error:
        raise ModelError(f"{path}: {error}, {expected}") from None
    except zipfile.BadZipFile:
        raise ModelError(f"{path}: got no NPZ file, {expected}") from None
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    except _DAMAGED as error:
        raise ModelError(f"{path}: damaged ({error}), {expected}") from None
    return model


def content_hash(model: AxesModel) -> str:
    """``sha256:`` and 16 digits of every number that a prediction depends on."""
    digest = hashlib.sha256()
    for name in (name for name in _NAMES if name not in _OPTIONAL):
        values = np.asarray(getattr(model, name), dtype="<f8")
        digest.update(repr(values.shape).encode() + values.tobytes())
    return f"sha256:{digest.hexdigest()[:16]}"
