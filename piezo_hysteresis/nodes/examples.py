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
    """Run an example from ``share/piezo_hysteresis/examples``, where a user can read and copy it."""
    folder = Path(get_package_share_directory("piezo_hysteresis")) / "examples"
    runpy.run_path(str(folder / f"{name}.py"), run_name="__main__")
