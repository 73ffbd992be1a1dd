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

"""Launch files on a ROS 2 installation: their arguments, and what they start."""

import importlib.util
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

launch = pytest.importorskip("launch", reason="no wheels of launch exist; runs on a ROS 2 installation")
pytest.importorskip("launch_ros")
from launch_ros.utilities import evaluate_parameters  # noqa: E402

STAGE_ARGUMENTS = {
    "namespace", "params_file", "use_sim_time", "model_file", "stage", "experiment", "real_time_factor", "autostart",
    "compensation", "one_process", "page",
}  # fmt: skip
FOLDER = Path(__file__).parents[1] / "launch"


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.launch.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("stage", STAGE_ARGUMENTS),
        ("identify", STAGE_ARGUMENTS),
        ("watch", {"axes", "address", "port", "token_file", "params_file"}),
        ("replay", {"bag", "axis", "rate", "namespace", "params_file", "use_sim_time", "model_file"}),
    ],
)
def test_every_argument_is_described(name, arguments):
    declared = load(name).generate_launch_description().get_launch_arguments()
    assert {argument.name for argument in declared} == arguments
    assert all(argument.description != "no description given" for argument in declared)


def test_replay_plays_no_command(tmp_path):
    values = {"bag": str(tmp_path), "axis": "stage_x", "namespace": "replay", "rate": "1.0"}
    player = load("replay").player_of(values)
    words = [part.text for word in player.cmd for part in word]
    assert words[words.index("--topics") + 1 : words.index("--remap")] == [
        "/stage_x/samples", "/stage_x/phase", "/stage_x/model",
    ]  # fmt: skip
    assert words[words.index("--remap") + 1 :] == [
        "/stage_x/samples:=/replay/samples", "/stage_x/phase:=/replay/phase", "/stage_x/model:=/replay/model",
    ]  # fmt: skip


RUN = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
service = LaunchService()
source = PythonLaunchDescriptionSource(sys.argv[1])
values = [value.split(":=") for value in sys.argv[2:]]
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=values)]))
sys.exit(service.run())
"""


@pytest.mark.nodes
def test_watch_opens_a_page_that_ends_with_the_launch():
    command = [sys.executable, "-c", RUN, str(FOLDER / "watch.launch.py"), "port:=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as running:
        lines = []
        for line in running.stdout:
            lines.append(line)
            if found := re.search(r"http://127\.0\.0\.1:\d+/", line):
                assert urllib.request.urlopen(found.group()).status == 200
                running.send_signal(signal.SIGINT)
        assert running.wait(60.0) == 0, "".join(lines)
    assert any("process has finished cleanly" in line for line in lines), "".join(lines)


@pytest.mark.parametrize(
    ("name", "value"),
    [("autostart", "maybe"), ("use_sim_time", "yes"), ("params_file", "/nowhere/at_all.yaml"), ("stage", "nothing")],
)
def test_unknown_words_are_refused(name, value):
    """`launch` itself refuses words that are no choice, the launch file the rest; nothing is started."""
    context = launch.LaunchContext()
    context.launch_configurations[name] = value
    entities = load("stage").generate_launch_description().entities
    with pytest.raises((RuntimeError, ValueError), match=name):
        _ = [entity.visit(context) for entity in entities]


def parameters_of(executable, **values):
    context = launch.LaunchContext()
    stage = load("stage")
    context.launch_configurations.update({name: value for name, value, _, _ in stage.ARGUMENTS}, **values)
    node = next(node for node in stage.nodes(context) if node.node_executable == executable)
    return evaluate_parameters(context, node._Node__parameters)[-1]


def driver_parameters(**values):
    return parameters_of("driver_node", **values)


def test_an_argument_that_is_not_given_leaves_the_parameter_files_as_they_are():
    assert driver_parameters() == {}
    assert parameters_of("model_node") == {}
    assert parameters_of("compensation_node", compensation="true") == {}
    assert driver_parameters(autostart="false") == {"autostart": False}
    for node in ("model_node", "compensation_node"):
        assert parameters_of(node, compensation="true", model_file="m.yaml") == {"model_file": "m.yaml"}


def test_an_experiment_is_replayed_at_the_requested_speed():
    given = driver_parameters(experiment="/data/run 1", real_time_factor="2")
    assert given == {
        "stage": "replay", "replay.experiment": "/data/run 1", "real_time_factor": 2.0
    }  # fmt: skip
    for wrong in ({"experiment": "x", "stage": "simulated"}, {"real_time_factor": "fast"}):
        with pytest.raises(ValueError, match="got"):
            driver_parameters(**wrong)


def test_only_the_model_node_follows_simulated_time():
    context = launch.LaunchContext()
    stage = load("stage")
    context.launch_configurations.update({name: value for name, value, _, _ in stage.ARGUMENTS}, use_sim_time="True")
    given = {}
    for node in stage.nodes(context):
        given[node.node_executable] = evaluate_parameters(context, node._Node__parameters)[-1]
    assert "use_sim_time" not in given["driver_node"]
    assert given["model_node"]["use_sim_time"] is True
