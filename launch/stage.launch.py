"""One axis: its driver, and the model node that predicts as soon as it has a model."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = (
    ("namespace", "", "namespace of the axis, e.g. stage_x"),
    ("params_file", "", "parameter file for all nodes, read after those in share/piezo_hysteresis/config"),
    ("use_sim_time", "false", "stamps follow /clock"),
    ("model_file", "", "first model of the model node; empty: it waits for the topic model"),
    ("stage", "", "back end of the driver: simulated, replay; empty: as the parameter files say"),
    ("autostart", "true", "configure and activate the driver at start"),
)


def generate_launch_description() -> LaunchDescription:
    arguments = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    config = Path(get_package_share_directory("piezo_hysteresis")) / "config"

    def node(executable: str, defaults: str, **parameters: object) -> Node:
        files = [str(config / defaults), *([value["params_file"]] if value["params_file"] else [])]
        return Node(
            package="piezo_hysteresis",
            executable=executable,
            namespace=value["namespace"],
            parameters=[*files, {"use_sim_time": value["use_sim_time"] == "true", **parameters}],
            output="screen",
            sigterm_timeout="30",  # a driver ramps to its safe voltage first
        )

    stage = {"stage": value["stage"]} if value["stage"] else {}
    model = {"model_file": value["model_file"]} if value["model_file"] else {}
    return [
        node("driver_node", "driver.yaml", autostart=value["autostart"] == "true", **stage),
        node("model_node", "model.yaml", **model),
    ]
