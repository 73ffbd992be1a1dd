"""Launch files on a ROS 2 installation: their arguments, and what they start."""

import importlib.util
from pathlib import Path

import pytest

launch = pytest.importorskip("launch", reason="no wheels of launch exist; runs on a ROS 2 installation")
pytest.importorskip("launch_ros")

FOLDER = Path(__file__).parents[1] / "launch"


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.launch.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("stage", {"namespace", "params_file", "use_sim_time", "model_file", "stage", "autostart"}),
        ("identify", {"namespace", "params_file", "use_sim_time", "model_file", "stage", "autostart"}),
        ("replay", {"bag", "axis", "rate", "namespace", "params_file", "use_sim_time", "model_file"}),
    ],
)
def test_every_argument_is_described(name, arguments):
    declared = load(name).generate_launch_description().get_launch_arguments()
    assert {argument.name for argument in declared} == arguments
    assert all(argument.description != "no description given" for argument in declared)


def test_replay_plays_no_command(tmp_path):
    replay = load("replay")
    context = launch.LaunchContext()
    context.launch_configurations.update(
        {**dict.fromkeys(("params_file", "model_file"), ""), "bag": str(tmp_path), "axis": "stage_x", "rate": "1.0"},
        namespace="replay",
        use_sim_time="true",
    )
    player = next(a for a in replay.actions(context) if type(a) is launch.actions.ExecuteProcess)
    words = [part.text for word in player.cmd for part in word]
    assert words[words.index("--topics") + 1 : words.index("--remap")] == [
        "/stage_x/samples", "/stage_x/phase", "/stage_x/model",
    ]  # fmt: skip
    assert words[words.index("--remap") + 1 :] == [
        "/stage_x/samples:=/replay/samples", "/stage_x/phase:=/replay/phase", "/stage_x/model:=/replay/model",
    ]  # fmt: skip
