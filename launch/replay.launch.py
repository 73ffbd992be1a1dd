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

"""A bag played into a model node of its own namespace: `samples`, `phase` and `model`, never `command`."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import Action, LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit, OnProcessIO
from launch.events import Shutdown
from launch.events.process import ProcessIO
from launch.logging import launch_config
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from piezo_hysteresis.nodes.runtime.launch_values import LISTENING, SWITCH, parameter_file, switch, transports

ARGUMENTS = (
    ("bag", None, "path of the bag"),
    ("axis", "", "namespace of the axis in the bag, e.g. stage_x"),
    ("rate", "1.0", "speed of playing"),
    ("namespace", "replay", "namespace that the bag is played into; no driver may live there"),
    ("params_file", "", "parameter file of the model node, read after the one in share/piezo_hysteresis/config"),
    ("use_sim_time", "true", "the model node follows the clock of the bag"),
    ("model_file", "", "model file; empty: the model in the bag"),
)
PLAYED = ("samples", "phase", "model")
DISCOVERY = "2"
"""Time that the player waits for its subscribers before the first message [s]."""


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument(
            name,
            default_value=value,
            description=text,
            choices=list(SWITCH) if name == "use_sim_time" else None,
        )
        for name, value, text in ARGUMENTS
    ]
    room = [SetEnvironmentVariable(*pair) for pair in transports(os.environ, config_folder()).items()]
    return LaunchDescription([*arguments, *room, OpaqueFunction(function=actions)])


def actions(context: LaunchContext) -> list[Action]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    model = {"model_file": value["model_file"]} if value["model_file"] else {}
    model_node = Node(
        package="piezo_hysteresis",
        executable="model_node",
        namespace=value["namespace"],
        parameters=[
            str(config_folder() / "model.yaml"),
            *parameter_file("params_file", value["params_file"]),
            {"use_sim_time": switch("use_sim_time", value["use_sim_time"]), **model},
        ],
        output="screen",
    )
    player = player_of(value)
    begin = OnProcessIO(target_action=model_node, **dict.fromkeys(("on_stdout", "on_stderr"), starter(player)))
    end = OnProcessExit(target_action=player, on_exit=[EmitEvent(event=Shutdown())])
    return [RegisterEventHandler(begin), RegisterEventHandler(end), model_node]


def player_of(value: Mapping[str, str]) -> ExecuteProcess:
    """The player of the bag, for some values of the arguments."""
    played = [topic(value["axis"], name) for name in PLAYED]
    renamed = [f"{old}:={topic(value['namespace'], name)}" for old, name in zip(played, PLAYED, strict=True)]
    return ExecuteProcess(
        cmd=["ros2", "bag", "play", value["bag"], "--clock", "100", "--rate", value["rate"], "--delay", DISCOVERY]
        + ["--qos-profile-overrides-path", str(deep_queues(value["axis"]))]
        + ["--topics", *played, "--remap", *renamed],
        output="screen",
    )


def deep_queues(axis: str) -> Path:
    """File with the queues of the recorder for the player, whose own of 10 messages lose blocks of a busy reader."""
    recorder = yaml.safe_load((config_folder() / "record_qos.yaml").read_text())
    file = Path(launch_config.log_dir) / "replay_qos.yaml"
    file.write_text(yaml.safe_dump({topic(axis, name): recorder[f"/{name}"] for name in PLAYED}))
    return file


def config_folder() -> Path:
    """Folder of the configuration files of the package."""
    return Path(get_package_share_directory("piezo_hysteresis")) / "config"


def starter(player: Action) -> Callable[[ProcessIO], Action | None]:
    """Start the player once the model node listens; what is played before, while it compiles, would be lost."""
    waiting = [player]
    return lambda event: waiting.pop() if waiting and LISTENING.encode() in event.text else None


def topic(namespace: str, name: str) -> str:
    return f"/{namespace.strip('/')}/{name}".replace("//", "/")
