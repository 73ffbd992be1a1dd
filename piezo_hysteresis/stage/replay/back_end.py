"""How a driver opens a recording in place of a device."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import RecordingError
from ...parameter import Row, Setting
from ..opening import Opening
from ..stage import Stage
from .stage import ReplayStage

PARAMETERS: tuple[Row, ...] = (
    Setting("experiment", "", "path of the recording"),
    Setting("repeat", False, "begin again after the last sample"),
    Setting("subscribers", 0, "begin when so many subscribers of samples are there", lower=0, upper=1000),
)
"""Of the driver, under ``replay.``."""


def open(values: Mapping[str, Any], opening: Opening) -> Stage:
    """Read the recording that `PARAMETERS` name and open it; PiezoError if it cannot be read."""
    path = values["experiment"]
    if not path:
        raise RecordingError("replay.experiment: got no path, expected that of a recording")
    return ReplayStage(
        opening.read(path),
        name=f"replay of {Path(path).name}",
        repeat=values["repeat"],
        sample_period=opening.sample_period,
    )
