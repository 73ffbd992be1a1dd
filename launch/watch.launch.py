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

"""The live page of axes that are running, or will be: a process that subscribes and calls services."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from piezo_hysteresis.nodes.runtime.launch_values import parameter_file, transports, whole_number

ARGUMENTS = (
    ("axes", "", "namespaces to show, with commas between; empty: every axis that publishes samples"),
    ("address", "", "address to listen on; one that other machines reach needs token_file; empty: as the files say"),
    ("port", "", "port to listen on, 0 takes a free one; empty: as the files say (5006)"),
    ("token_file", "", "file with the token that a visitor has to give"),
    ("params_file", "", "parameter file, read after the one in share/piezo_hysteresis/config"),
)


def generate_launch_description() -> LaunchDescription:
    arguments = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"
    room = [SetEnvironmentVariable(*pair) for pair in transports(os.environ, config).items()]
    return LaunchDescription([*arguments, *room, OpaqueFunction(function=page)])


def page(context: LaunchContext) -> list[Node]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"
    given: dict[str, object] = {name: value[name] for name in ("axes", "address", "token_file") if value[name]}
    if value["port"]:
        given["port"] = whole_number("port", value["port"])
    files = [str(config / "page.yaml"), *parameter_file("params_file", value["params_file"])]
    parameters = [*files, given] if given else files
    return [Node(package="piezo_hysteresis", executable="page_node", parameters=parameters, output="screen")]
