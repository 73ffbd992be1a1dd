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

"""Build script of the ROS 2 package; colcon and pip read it."""

import re
import xml.etree.ElementTree as ElementTree
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = "piezo_hysteresis"
HERE = Path(__file__).parent
README = HERE / "README.md"  # not in the folder in which colcon builds
SOURCE = (HERE / NAME / "__init__.py").read_text(encoding="utf-8")
VERSION = re.search(r'^__version__ = "(.+)"$', SOURCE, re.MULTILINE)[1]
EXAMPLES = ("send_scan", "send_waveform", "set_voltage")  # `ros2 run piezo_hysteresis send_waveform`
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()  # maintainer and address are written down there alone
MAINTAINER = MANIFEST.find("maintainer")

setup(
    name=NAME,
    version=VERSION,
    description="Hysteresis and dynamics of piezo-actuated stages: models, identification, live prediction over ROS 2",
    long_description=README.read_text(encoding="utf-8") if README.exists() else "",
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    url=MANIFEST.findtext("url"),
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: ["py.typed"],
        f"{NAME}.export": ["templates/*.jinja"],
        f"{NAME}.report": ["page.css", "page.html.jinja"],
        f"{NAME}.report.live": ["page.css", "page.html.jinja", "panels.css"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", glob("config/*")),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/examples", [f"examples/{name}.py" for name in EXAMPLES]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "h5py",
        "jinja2",
        "matplotlib",
        "lz4",
        "mcap",
        "numba",
        "numpy",
        "PyYAML",
        "rich",
        "rosbags",
        "scipy",
        "threadpoolctl",
        "zstandard",
    ],
    extras_require={
        "fleet": ["aiohttp", "bokeh", "dask", "distributed", "fsspec", "pyarrow"],
        "fmu": ["fmpy"],
        "hardware": ["nidaqmx[grpc]"],
        "labview": ["npTDMS"],
        "live": ["bokeh", "tornado"],
        "notebook": ["jupyterlab", "jupytext", "pandas", "xarray"],
        "rerun": ["rerun-sdk"],
        "ros": [
            "ros-kilted-diagnostic-msgs",
            "ros-kilted-rclpy",
            "ros-kilted-rmw-fastrtps-cpp",
            "ros-kilted-sensor-msgs",
            "ros-kilted-std-msgs",
            "ros-kilted-std-srvs",
        ],
        "test": ["hypothesis", "pytest"],
        "test-hardware": ["nidaqmx[grpc]==1.7.0", "pipython==2.11.0.6"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            f"axis_node = {NAME}.nodes.start:axis_node",
            f"driver_node = {NAME}.nodes.start:driver_node",
            f"model_node = {NAME}.nodes.start:model_node",
            f"axes_model_node = {NAME}.nodes.start:axes_model_node",
            f"identification_node = {NAME}.nodes.start:identification_node",
            f"compensation_node = {NAME}.nodes.start:compensation_node",
            f"page_node = {NAME}.nodes.start:page_node",
            f"keeper = {NAME}.acquisition.safety.keeper:main",
            f"piezo = {NAME}.cli.main:main",
            *(f"{name} = {NAME}.nodes.examples:{name}" for name in EXAMPLES),
        ]
    },
)
