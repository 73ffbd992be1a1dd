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

"""Show the progress of the identification node of an axis in one line, until it has finished; needs ROS 2."""

from __future__ import annotations

import argparse
import subprocess
import sys
from importlib.util import find_spec

from ...errors import PiezoError


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("follow", description=__doc__)
    parser.add_argument("namespace", nargs="?", default="", help="namespace of the axis, e.g. /stage_x")
    parser.add_argument("ros", nargs=argparse.REMAINDER, help="arguments for ROS 2, from --ros-args on")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Follow the axis in a process that imports ROS; its exit status.

    Raises
    ------
    PiezoError
        Where ROS 2 is not installed.
    """
    if find_spec("rclpy") is None:
        raise PiezoError("follow: got no rclpy, expected ROS 2; source its setup file, or install the wheels of rclpy")
    program = [sys.executable, "-m", "piezo_hysteresis.nodes.follow", args.namespace, *args.ros]
    try:
        return subprocess.run(program, check=False).returncode
    except KeyboardInterrupt:
        return 130
