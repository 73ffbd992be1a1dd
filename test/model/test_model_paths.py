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

"""Files of models are read without waiting, and a path that cannot be is one clear line."""

import os
from pathlib import Path

import pytest

import piezo_hysteresis
from piezo_hysteresis.errors import ModelError, ParameterError
from piezo_hysteresis.home_path import in_home
from piezo_hysteresis.model import axes_file, model_file


@pytest.mark.parametrize("load", [axes_file.load, model_file.load])
def test_a_pipe_is_refused_and_not_waited_for(tmp_path, load):
    """A node that opened it never answered again."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ModelError, match="expected a"):
        load(tmp_path / "pipe")


def test_one_function_looks_for_home_folders():
    """`Path.expanduser` ends with an error of its own where there is no such user."""
    package = Path(piezo_hysteresis.__file__).parent
    assert [f.name for f in package.rglob("*.py") if "expanduser(" in f.read_text()] == ["home_path.py"]


def test_the_home_of_nobody_is_refused_in_one_line():
    assert in_home("~/x").is_absolute()
    for use in (in_home, axes_file.load, model_file.load):
        with pytest.raises(ParameterError, match="there is no home folder of that user"):
            use("~no_such_user/x.yaml")
