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

"""Real node processes over real DDS: a domain of its own for every test, shared memory only."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle, islice
from pathlib import Path

import pytest

os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "SHM")

from piezo_hysteresis.acquisition.stage_lock import StageLock
from piezo_hysteresis.errors import StageError

from .lab import Lab

DOMAINS = cycle(random.Random(os.getpid()).sample(range(1, 101), 100))
"""Each in its turn: what a killed process has left in one is not met by the next test."""


@contextmanager
def opened(folder: Path) -> Iterator[Lab]:
    """A lab in a ROS domain that nobody else tests in on this machine at the same time, nor did just before."""
    for number in islice(DOMAINS, 100):
        try:
            lock = StageLock([f"test in domain {number}"])
            break
        except StageError:
            continue
    else:
        pytest.fail("all domains from 1 to 100 are taken")
    lab = Lab(number, folder)
    try:
        yield lab
    finally:
        lab.close()
        lock.release()


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """The test's own node; processes that it starts are ended with the test."""
    with opened(tmp_path) as lab:
        yield lab


@pytest.fixture(scope="module")
def shared_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """One lab for all tests of a file."""
    with opened(tmp_path_factory.mktemp("lab")) as lab:
        yield lab
