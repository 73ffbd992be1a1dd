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

"""One axis: its driver, the model node that predicts as soon as it has a model; compensation and page where asked."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from piezo_hysteresis.nodes.runtime.launch_values import (
    SWITCH,
    number,
    parameter_file,
    replayed,
    require_computer_clock,
    switch,
    transports,
)
from piezo_hysteresis.stage.back_ends import BACK_ENDS

SIGTERM_TIMEOUT = "30"
"""A driver ramps to its safe voltage before it ends; launch must not kill it before that [s]."""

ARGUMENTS = (
    ("namespace", "", "namespace of the axis, e.g. stage_x", None),
    ("params_file", "", "parameter file for all nodes, read after those in share/piezo_hysteresis/config", None),
    ("use_sim_time", "false", "the model node follows /clock; a driver never does", list(SWITCH)),
    ("model_file", "", "first model of the model and compensation node; empty: as the parameter files say", None),
    ("stage", "", f"back end of the driver: {', '.join(BACK_ENDS)}; empty: as the parameter files say",
     ["", *BACK_ENDS]),
    ("experiment", "", "recording for the back end replay, which it implies; all its phases are played", None),
    ("real_time_factor", "", "speed of a simulated or replayed stage; empty: as the parameter files say", None),
    ("autostart", "", "configure and activate the driver at start; empty: as the parameter files say", ["", *SWITCH]),
    ("compensation", "false", "start the compensation node, too: it follows trajectories in metres", list(SWITCH)),
    ("one_process", "false", "driver, model and identification node in one process", list(SWITCH)),
    ("page", "false", "show every axis on a page in the browser, http://127.0.0.1:5006", list(SWITCH)),
)  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=text, choices=choices)
        for name, value, text, choices in ARGUMENTS
    ]
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"
    room = [SetEnvironmentVariable(*pair) for pair in transports(os.environ, config).items()]
    return LaunchDescription([*arguments, *room, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _, _ in ARGUMENTS}
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"

    def node(executable: str, defaults: str, **parameters: object) -> Node:
        files = [str(config / defaults), *parameter_file("params_file", value["params_file"])]
        return Node(
            package="piezo_hysteresis",
            executable=executable,
            namespace=value["namespace"],
            parameters=[*files, parameters],
            output="screen",
            sigterm_timeout=SIGTERM_TIMEOUT,
        )

    driver: dict[str, object] = {}
    if value["autostart"]:
        driver["autostart"] = switch("autostart", value["autostart"])
    if value["experiment"]:
        driver |= {"stage": replayed(value["stage"]), "replay.experiment": value["experiment"]}
    elif value["stage"]:
        driver["stage"] = value["stage"]
    if value["real_time_factor"]:
        driver["real_time_factor"] = number("real_time_factor", value["real_time_factor"])
    first: dict[str, object] = {"model_file": value["model_file"]} if value["model_file"] else {}
    model = first | ({"use_sim_time": True} if switch("use_sim_time", value["use_sim_time"]) else {})
    if switch("one_process", value["one_process"]):
        require_computer_clock("use_sim_time" in model)
        started = [node("axis_node", "driver.yaml", **driver, **model)]
    else:
        started = [node("driver_node", "driver.yaml", **driver), node("model_node", "model.yaml", **model)]
    if switch("compensation", value["compensation"]):
        started.append(node("compensation_node", "compensation.yaml", **first))
    if switch("page", value["page"]):
        started.append(page_node(config / "page.yaml"))
    return started


def page_node(file: Path) -> Node:
    """One page shows all axes, so it has no namespace."""
    return Node(package="piezo_hysteresis", executable="page_node", parameters=[str(file)], output="screen")
