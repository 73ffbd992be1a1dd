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

"""Entry points of the node executables: they import nothing slow before interrupts are handled."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module

from ..errors import MissingPackageError
from .runtime.interrupt import remember_interrupts

ROS_PACKAGES = (
    "action_msgs", "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "lifecycle_msgs", "rcl_interfaces",
    "rclpy", "sensor_msgs", "std_msgs", "std_srvs",
)  # fmt: skip
"""Python packages that ROS 2 brings."""
NOT_INSTALLED = 2
"""Exit status of a node without ROS 2, or without a package that it needs."""


def axis_node() -> int:
    """Run driver, model and identification node in one process."""
    return _run("axis_node")


def driver_node() -> int:
    """Run a driver."""
    return _run("driver.driver_node")


def model_node() -> int:
    """Run a model node."""
    return _run("model.model_node")


def axes_model_node() -> int:
    """Run a model node of several axes."""
    return _run("several_axes.axes_model_node")


def identification_node() -> int:
    """Run an identification node."""
    return _run("identification.identification_node")


def compensation_node() -> int:
    """Run a compensation node."""
    return _run("compensation.compensation_node")


def page_node() -> int:
    """Run a live page. It simulates nothing, and stays 60 MB smaller without the compiler."""
    os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
    return _run("page.page_node")


def _run(module: str) -> int:
    remember_interrupts()
    try:
        return int(import_module(f".{module}", __package__).main())
    except (KeyboardInterrupt, ImportError) as error:
        if _was_interrupted(error):
            return 128 + signal.SIGINT
        if isinstance(error, MissingPackageError):
            sys.stderr.write(f"{module.rpartition('.')[2]}: {error}\n")
            return NOT_INSTALLED
        missing = (error.name or "").partition(".")[0] if isinstance(error, ImportError) else ""
        if missing in ROS_PACKAGES:
            sys.stderr.write(
                f"{module.rpartition('.')[2]}: got no Python package '{missing}', expected ROS 2; load its setup.bash, "
                "or on Linux x86-64 type pip install '.[ros]' in the source folder\n"
            )
            return NOT_INSTALLED
        raise


def _was_interrupted(error: BaseException | None) -> bool:
    """Whether an import failed by an interrupt, which some libraries turn into an ImportError."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
