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

"""Identify a piezo stage, predict its displacement live, and find the physical effect that is missing in its model.

docs/architecture.md describes the rooms (the folders), their contents, and their dependencies.

Examples
--------
>>> from piezo_hysteresis import Record
>>> Record([0.0, 1.0], [0.0, 2e-6], 1e-3).duration
0.002
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import PiezoError
from .picture import draw_with

if TYPE_CHECKING:
    from .discrepancy import diagnose
    from .identification import identify
    from .model.model import Model
    from .model.model_file import load, save
    from .online.predictor import Predictor
    from .record import Experiment, Record
    from .recording import from_columns, read, to_columns
    from .report.plot import plot

__version__ = "0.1.0"
"""Version of the package, as in package.xml and CHANGELOG.md."""

_ROOMS = {
    "Experiment": "record",
    "Model": "model.model",
    "Predictor": "online.predictor",
    "Record": "record",
    "diagnose": "discrepancy",
    "from_columns": "recording",
    "identify": "identification",
    "load": "model.model_file",
    "plot": "report.plot",
    "read": "recording",
    "save": "model.model_file",
    "to_columns": "recording",
}
"""Public names of the package and the module that each is loaded from when it is first used."""

__all__ = [
    "Experiment",
    "Model",
    "PiezoError",
    "Predictor",
    "Record",
    "diagnose",
    "from_columns",
    "identify",
    "load",
    "plot",
    "read",
    "save",
    "to_columns",
]


def __getattr__(name: str) -> Any:
    """Load a module when one of its public names is first used, so that `piezo --help` needs no compiler."""
    if name not in _ROOMS:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f".{_ROOMS[name]}", __name__), name)


draw_with(lambda: __getattr__("plot"))
