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

"""What the package says about itself is true: versions, dependencies, executables, parameter files."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import piezo_hysteresis
from piezo_hysteresis import recording
from piezo_hysteresis.record import Experiment, Record
from scripts.ros_changelog import in_rst

ROOT = Path(__file__).parents[1]
PACKAGE = ElementTree.parse(ROOT / "package.xml").getroot()
ROSDEP = {"yaml": "python3-yaml", "rosbags": "python3-rosbags-pip", "bokeh": "python3-bokeh-pip"}
NO_KEY = {"lz4", "mcap", "threadpoolctl", "zstandard"}
"""No rosdep key; the README names them for pip, but for what mcap itself needs: lz4 and zstandard."""


OPTIONAL = {"grpc", "nidaqmx", "nptdms", "rerun"}
"""Only for hardware, files of LabVIEW and the Rerun viewer: the extras `hardware`, `labview`, `rerun` in setup.py."""


def modules():
    return sorted((ROOT / "piezo_hysteresis").rglob("*.py"))


def imported():
    """Top-level names of everything that the package imports from outside."""
    names = set()
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.split(".")[0])
    return names - set(sys.stdlib_module_names) - {"piezo_hysteresis"}


def test_versions_agree():
    version = PACKAGE.findtext("version")
    assert version == piezo_hysteresis.__version__
    assert "version=VERSION" in (ROOT / "setup.py").read_text()
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text()


def test_the_package_of_actions_has_the_same_version_and_maintainer():
    actions = ElementTree.parse(ROOT / "interfaces" / "package.xml").getroot()
    for tag in ("version", "maintainer", "license"):
        assert actions.findtext(tag) == PACKAGE.findtext(tag)
    assert actions.find("maintainer").get("email") == PACKAGE.find("maintainer").get("email")


@pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")  # catkin_pkg calls it
def test_release_tools_of_ros_read_every_change():
    changelog = pytest.importorskip("catkin_pkg.changelog")
    pytest.importorskip("docutils")
    markdown = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "Forthcoming\n-----------" in in_rst("## 0.1.0 (unreleased)")
    released = changelog.Changelog("piezo_hysteresis")
    changelog.populate_changelog_from_rst(released, in_rst(markdown.replace("unreleased", "2026-12-01")))
    changes = [len(re.findall(r"^[*] ", part, re.MULTILINE)) for part in markdown.split("\n## ")[1:]]
    assert [len(content[0].bullets) for _, _, content in released.foreach_version()] == changes


def test_every_import_is_a_dependency():
    declared = {element.text for element in PACKAGE.iter("exec_depend")}
    missing = {
        name
        for name in imported() - NO_KEY - OPTIONAL
        if not declared & {name, f"python3-{name}", ROSDEP.get(name, name)}
    }
    assert not missing


def test_every_dependency_that_pip_brings_is_pinned():
    locked = (ROOT / "requirements.txt").read_text() + (ROOT / "constraints.txt").read_text()
    pinned = {re.sub("[-_.]+", "-", name).lower() for name in re.findall(r"^([\w.-]+)==", locked, re.MULTILINE)}
    wanted = re.search(r"install_requires=\[(.*?)\]", (ROOT / "setup.py").read_text(), re.DOTALL)
    assert {name.lower() for name in re.findall(r'"([\w.-]+)"', wanted.group(1))} <= pinned


@pytest.mark.parametrize(
    "name", ["driver_node", "model_node", "identification_node", "compensation_node", "page_node", "keeper", "piezo"]
)
def test_executables_name_a_function_that_exists(name):
    entry = re.search(rf"{name} = {{NAME}}\.([\w.]+):(\w+)", (ROOT / "setup.py").read_text())
    source = ROOT / "piezo_hysteresis" / (entry.group(1).replace(".", "/") + ".py")
    functions = {node.name for node in ast.parse(source.read_text()).body if isinstance(node, ast.FunctionDef)}
    assert entry.group(2) in functions


def test_driver_parameters_in_the_file_are_the_defaults_of_the_table():
    from piezo_hysteresis.acquisition.settings import DRIVER
    from piezo_hysteresis.stage.back_ends import BACK_ENDS

    values = yaml.safe_load((ROOT / "config" / "driver.yaml").read_text())["/**"]["ros__parameters"]
    rows = {row.name: row for row in DRIVER}
    for word, back_end in BACK_ENDS.items():
        for name, value in values.pop(word, {}).items():
            assert value == {row.name: row for row in back_end.rows}[name].value, name
    assert set(values) == set(rows)
    for name, value in values.items():
        assert rows[name].check(value) == rows[name].value, name


@pytest.mark.parametrize("node", ["driver_node", "model_node", "identification_node", "compensation_node", "page_node"])
def test_a_node_without_ros_ends_in_one_line(node):
    hidden = "import sys; sys.modules['rclpy'] = None; from piezo_hysteresis.nodes import start; "
    command = [sys.executable, "-c", f"{hidden} sys.exit(start.{node}())"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith(f"{node}: got no Python package 'rclpy', expected ROS 2")


def test_the_page_without_its_extra_ends_in_one_line(tmp_path):
    recording.write(Experiment((Record([0.0, 1.0], [0.0, 1e-6], 1e-3),)), tmp_path / "experiment")
    hidden = "import sys; sys.modules['bokeh'] = None; "
    view = "from piezo_hysteresis.cli.main import main; sys.exit(main(['view', sys.argv[1]]))"
    page = "from piezo_hysteresis.nodes import start; sys.exit(start.page_node())"
    for program in (view, page):
        command = [sys.executable, "-c", hidden + program, tmp_path / "experiment"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
        (line,) = done.stderr.splitlines()
        assert done.returncode == 2
        assert "got no Python package 'bokeh', expected the extra 'live'" in line


@pytest.mark.parametrize("node", ["driver", "model", "identification", "compensation"])
def test_a_node_loads_nothing_heavy(node):
    heavy = "{'scipy.optimize', 'scipy.signal', 'scipy.stats', 'matplotlib', 'bokeh'}"
    code = f"import sys, piezo_hysteresis.nodes.{node}.{node}_node; sys.exit(str({heavy} & set(sys.modules) or 0))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "0"


def test_the_command_prints_its_version():
    command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "--version"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    assert said == f"piezo_hysteresis {piezo_hysteresis.__version__}\n"


def test_the_types_are_for_users_too():
    assert (ROOT / "piezo_hysteresis" / "py.typed").exists()
    assert '"py.typed"' in (ROOT / "setup.py").read_text()


def test_the_core_needs_no_ros():
    code = "import sys; sys.modules['rclpy'] = None; import piezo_hysteresis as p; [getattr(p, n) for n in p.__all__]"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=120)


@pytest.mark.soak
def test_wheel_and_source_distribution_pass_their_check():
    subprocess.run([ROOT / "scripts" / "dist"], check=True, timeout=1800)
    (wheel,) = (ROOT / "dist").glob("*.whl")
    assert wheel.name.startswith(f"piezo_hysteresis-{piezo_hysteresis.__version__}-py3")
    needed = {part["name"].lower() for part in json.loads((ROOT / "dist" / "sbom.cdx.json").read_text())["components"]}
    assert {"numpy", "numba", "matplotlib"} <= needed
    assert not [name for name in needed if name.startswith("ros-")]
    assert "| numpy" in (ROOT / "dist" / "licences.md").read_text()


def test_the_locked_file_has_a_hash_for_everything_that_is_required():
    text = (ROOT / "requirements-locked.txt").read_text()
    parts = re.split(r"\n(?=\S)", text.strip())
    locked = {re.match(r"([\w.-]+)==", part)[1] for part in parts if "--hash=sha256:" in part}
    assert len(locked) == len(parts)
    wanted = re.search(r"install_requires=\[(.*?)\]", (ROOT / "setup.py").read_text(), re.DOTALL)
    assert {name.lower() for name in re.findall(r'"([\w.-]+)"', wanted.group(1))} <= locked


def test_the_tests_of_a_file_run_in_one_process(request):
    """pytest-xdist shows the group of a test in its name; without groups every process would make every fixture."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        assert request.node.nodeid.endswith("@test_package")


def test_every_benchmark_can_be_imported():
    names = [f"benchmarks.{file.stem}" for file in (ROOT / "benchmarks").glob("*.py") if file.stem != "__main__"]
    program = "import importlib, sys\nfor name in sys.argv[1:]: importlib.import_module(name)"
    done = subprocess.run(
        [sys.executable, "-c", program, *names], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
