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

"""One axis with everything that identification needs: driver, model node and identification node."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from piezo_hysteresis.nodes.runtime.launch_values import parameter_file, switch


def generate_launch_description() -> LaunchDescription:
    stage = Path(__file__).with_name("stage.launch.py")  # declares the arguments
    included = IncludeLaunchDescription(PythonLaunchDescriptionSource(str(stage)))
    return LaunchDescription([included, OpaqueFunction(function=identification)])


def identification(context: LaunchContext) -> list[Node]:
    namespace, file, together = (
        LaunchConfiguration(name).perform(context) for name in ("namespace", "params_file", "one_process")
    )
    if switch("one_process", together):
        return []  # it is in the process of the driver
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"
    node = Node(
        package="piezo_hysteresis",
        executable="identification_node",
        namespace=namespace,
        parameters=[str(config / "identification.yaml"), *parameter_file("params_file", file)],
        output="screen",
        sigterm_timeout="30",  # it leaves the stage safe and the recording readable
    )
    return [node]
