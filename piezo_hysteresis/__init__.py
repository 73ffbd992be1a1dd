"""Identify a piezo stage, predict it live, and be told which physical effect its model misses.

The rooms, each of which sees only those below it::

    nodes  cli      ROS 2 nodes; the `piezo` command
    report          figures and the HTML page
    discrepancy     the gap finder: `diagnose`
    identification  excitation, three steps, joint fit: `identify`
    predictor       prediction and residual, block by block
    model_file      a `Model` as ROS parameters: `load`, `save`
    model           `Model`: a chain of effects; chain: its coefficients at one sample period
    effects         the catalogue, one physical effect per file
    record          `Record`, `Experiment`; parameter: `Parameter`
    errors          the error tree

    stage, recording   beside the chain: simulated and real stages; files to and from `Experiment`: `read`

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

if TYPE_CHECKING:
    from .discrepancy import diagnose
    from .identification import identify
    from .model.model import Model
    from .model.model_file import load, save
    from .online.predictor import Predictor
    from .record import Experiment, Record
    from .recording import read

_ROOMS = {
    "Experiment": "record",
    "Model": "model.model",
    "Predictor": "online.predictor",
    "Record": "record",
    "diagnose": "discrepancy",
    "identify": "identification",
    "load": "model.model_file",
    "read": "recording",
    "save": "model.model_file",
}

__all__ = [
    "Experiment",
    "Model",
    "PiezoError",
    "Predictor",
    "Record",
    "diagnose",
    "identify",
    "load",
    "read",
    "save",
]


def __getattr__(name: str) -> Any:
    """Load a room when one of its public names is first asked for: `piezo --help` needs no compiler."""
    if name not in _ROOMS:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f".{_ROOMS[name]}", __name__), name)
