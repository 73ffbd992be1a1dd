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

"""Places of results are refused before the work begins, not after it."""

from __future__ import annotations

import os
import tempfile
from argparse import Namespace
from pathlib import Path

import pytest

from piezo_hysteresis.cli.options.destination import require_new_experiment, require_new_results
from piezo_hysteresis.errors import RecordingError

NOBODY = 65534


@pytest.fixture
def read_only():
    """A folder that this process cannot write, also where the tests run as root."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o555)
        users = os.getresuid()
        if users[1] == 0:
            os.setresuid(NOBODY, NOBODY, 0)
        try:
            yield Path(folder)
        finally:
            os.setresuid(*users)
            Path(folder).chmod(0o755)


@pytest.mark.parametrize("option", ["output", "report", "json", "figures"])
def test_a_result_in_a_folder_that_cannot_be_written_is_refused(read_only, option):
    with pytest.raises(RecordingError, match="expected a folder that can be written"):
        require_new_results(Namespace(**{option: str(read_only / "result")}, force=True))


def test_figures_into_a_folder_that_cannot_be_written_are_refused(read_only):
    with pytest.raises(RecordingError, match="expected a folder that can be written"):
        require_new_results(Namespace(figures=str(read_only), force=False))


def test_an_experiment_in_a_folder_that_cannot_be_written_is_refused(read_only):
    with pytest.raises(RecordingError, match="expected a folder that can be written"):
        require_new_experiment("-o", str(read_only / "experiment"))
