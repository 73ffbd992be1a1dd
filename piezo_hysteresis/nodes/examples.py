"""The installed examples as executables: ``ros2 run piezo_hysteresis send_waveform``."""

from __future__ import annotations

import runpy
from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def send_scan() -> None:
    """Send a wanted displacement to the compensation node."""
    _run("send_scan")


def send_waveform() -> None:
    """Play a waveform on a stage."""
    _run("send_waveform")


def set_voltage() -> None:
    """Ramp a stage to a voltage."""
    _run("set_voltage")


def _run(name: str) -> None:
    """Run an example as it stands in ``share/piezo_hysteresis/examples``, where a user may read and copy it."""
    folder = Path(get_package_share_directory("piezo_hysteresis")) / "examples"
    runpy.run_path(str(folder / f"{name}.py"), run_name="__main__")
