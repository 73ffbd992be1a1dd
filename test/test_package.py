"""What the package says about itself is true: versions, dependencies, executables, parameter files."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PACKAGE = ElementTree.parse(ROOT / "package.xml").getroot()
ROSDEP = {"yaml": "python3-yaml", "rosbags": "python3-rosbags-pip"}
NO_KEY = {"lz4", "mcap", "threadpoolctl", "zstandard"}
"""No rosdep key; the README names them for pip, but for what mcap itself needs: lz4 and zstandard."""


OPTIONAL = {"grpc", "nidaqmx", "nptdms"}
"""Only for hardware, and for files of LabVIEW: the extras `hardware` and `labview` in setup.py."""


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
    assert f'version="{version}"' in (ROOT / "setup.py").read_text()
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text()


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
    "name", ["driver_node", "model_node", "identification_node", "compensation_node", "keeper", "piezo"]
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
