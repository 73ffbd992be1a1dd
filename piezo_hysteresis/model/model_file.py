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

"""`model_file`: a `Model` as the parameter YAML that nodes, people and the CLI share.

Everything under ``model.`` is checked, and all other entries are ignored: a ``ros2 param dump`` of the identification
node is a valid model file, and a model file is a valid ``--params-file``. Units stand in the comments; all are SI.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import yaml

from ..errors import ModelError, RecordingError
from ..home_path import in_home
from ..yaml_file import read_regular_file
from .model import Model
from .model_parameters import COVARIANCE, PREFIX, SCALES, from_parameters, to_parameters
from .parameter_file import LONGEST_TEXT, Entry, entry, parameters, quoted

_HEADER = """\
# Model of a piezo stage: a ROS 2 parameter file, in SI units. Load it with --params-file, or give it to `piezo`.
# After editing a number by hand, delete the line `hash`.
"""
"""First lines of a model file."""

_LONGEST_CHARACTER = 4
"""Bytes of a character in UTF-8 at most."""

_ARCHIVE = b"PK\x03\x04"
"""First bytes of an NPZ file."""

_PROVENANCE = {
    "free_run_error": "m; rms in free run, on data left out where there were any; of `identify`, without rests",
    "free_run_error_percent": "% of the displacement range",
    "largest_record_error": "m; the largest rms of one record, fitted or left out",
    "moving_record_error": "m; rms in free run over the records in which the drive moves",
    "unseen_records": "whether one of these records was not fitted; errors of fitted records alone are no prediction",
    "data_hash": "of the samples that were fitted",
    "date": "UTC",
    "voltage_min": "V; of the records that were fitted",
    "voltage_max": "V",
    "frequency_min": "Hz; rate of the slowest drive between its steps",
    "frequency_max": "Hz; rate of the fastest sine, or below which 95 % of the power of dv/dt of another drive lies",
    "slew_rate_max": "V/s; that of 99 % of the samples that move",
    "step_rate_max": "V/s; the largest between two samples",
    "lag_uncertainty": "s; half of the 95 % interval of the lag, which no broadband record shows",
    "sample_periods": "s; of those records, where none is broadband",
}
"""Comments beside the entries of the provenance."""


def dumps(model: Model) -> str:
    """The text of a model file; reads back bit for bit.

    Raises
    ------
    ModelError
        If a provenance key is no lower-case identifier.
    """
    named = to_parameters(model)
    lines = ["/**:", "  ros__parameters:", "    model:"]

    def line(indent: int, key: str, value: Entry, comment: str) -> None:
        text = f"{' ' * indent}{key}: {entry(value)}"
        lines.append(f"{text}  # {comment}" if comment else text)

    line(6, "effects", named[PREFIX + "effects"], "the chain, from drive voltage to displacement")
    for name, (unit, meaning) in SCALES.items():
        line(6, name, named[PREFIX + name], f"{unit}; {meaning}")
    line(6, "valid", named[PREFIX + "valid"], "false: start values, not identified")
    line(6, "hash", named[PREFIX + "hash"], "of everything but valid, provenance and covariance")
    if model.provenance:
        lines.append("      provenance:")
        for key in model.provenance:
            name = key if yaml.safe_load(key) == key else quoted(key)  # "no" and "on" are truth values to PyYAML
            line(8, name, named[f"{PREFIX}provenance.{key}"], _PROVENANCE.get(key, ""))
    for effect in model.effects:
        rows = [p for p in effect.parameters if f"{PREFIX}{effect.name}.{p.name}" in named]
        if rows:
            lines.append(f"      {effect.name}:  # {effect.equation}")
        for row in rows:
            line(8, row.name, named[f"{PREFIX}{effect.name}.{row.name}"], f"{row.unit}; {row.meaning}")
    if PREFIX + COVARIANCE + "factor" in named:
        lines.append("      covariance:  # of the numbers that were fitted: F Fᵀ")
        line(8, "names", named[f"{PREFIX}{COVARIANCE}names"], "of the rows of F")
        line(8, "factor", named[f"{PREFIX}{COVARIANCE}factor"], "F, row by row")
    return _HEADER + "\n".join(lines) + "\n"


def loads(text: str, source: str = "model file") -> Model:
    """The model in the text of a model file or of a ``ros2 param dump``.

    Raises
    ------
    ModelError, ParameterError
        As `from_parameters`; also if the YAML is broken or holds no model, or different ones.
    """
    own = [
        {name: value for name, value in named.items() if name.startswith(PREFIX)}
        for named in parameters(text, source).values()
    ]
    found = [named for named in own if named]
    if not found:
        raise ModelError(f"{source}: got parameters but no 'model', expected a model file or a dump with one")
    if any(named != found[0] for named in found):
        raise ModelError(f"{source}: got {len(found)} different models, expected one; keep the wanted node only")
    return from_parameters(found[0], source)


def require_name(path: str | Path) -> None:
    """Refuse a name that is not one of a model of one axis.

    Raises
    ------
    ModelError
        If it ends in ``.npz``.
    """
    if Path(path).suffix == ".npz":
        raise ModelError(f"{path}: a model of one axis is a YAML file; give it a name that ends in .yaml")


def save(model: Model, path: str | Path) -> Path:
    """Write a model file, which appears only when it is complete; returns its path.

    Raises
    ------
    ModelError
        If the name ends in ``.npz`` or the file cannot be written.
    """
    path = in_home(path)
    require_name(path)
    text = dumps(model)
    draft = path.with_name(path.name + ".tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)
    except (OSError, UnicodeError) as error:
        with suppress(OSError):
            draft.unlink()
        raise ModelError(f"{path}: cannot write the model file: {error}") from None
    return path


def load(path: str | Path) -> Model:
    """Read a model file.

    Raises
    ------
    ModelError, ParameterError
        If there is no such file, if it is a folder, a pipe or a device, or as `loads`.
    """
    path = in_home(path)
    try:
        raw = read_regular_file(path, _LONGEST_CHARACTER * (LONGEST_TEXT + 1))
        if raw.startswith(_ARCHIVE):
            raise ModelError(
                f"{path}: got an NPZ file, as a model of several axes is, expected a model file of one axis; piezo "
                "identify and piezo validate handle several axes"
            )
        text = raw.decode("utf-8")
    except RecordingError as error:
        raise ModelError(str(error)) from None
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}, expected a model file") from None
    except UnicodeError:
        raise ModelError(f"{path}: not a text in UTF-8, expected a model file") from None
    return loads(text, str(path))
