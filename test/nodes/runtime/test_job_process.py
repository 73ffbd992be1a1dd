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

"""A job in another process hears and answers, and its death is an error that says so, whoever speaks next."""

from __future__ import annotations

import operator
import os
import signal
import time

import pytest

from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.nodes.runtime.job_process import JobProcess

ECHO = operator.methodcaller("receive")
"""A job that returns what it hears first."""


def message(job):
    deadline = time.monotonic() + 60.0
    while (found := job.poll()) is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return found


def test_a_job_returns_its_input():
    job = JobProcess("test", ECHO)
    try:
        job.send(6)
        assert message(job) == 6
    finally:
        job.close()


def test_a_suspended_job_can_be_ended():
    """SIGTERM waits until it goes on, and the node waited with it."""
    job = JobProcess("test", ECHO)
    os.kill(job.pid, signal.SIGSTOP)
    job.close()
    with pytest.raises(ProcessLookupError):
        os.kill(job.pid, 0)


def test_a_death_before_anything_was_heard_is_reported():
    job = JobProcess("test", ECHO)
    try:
        os.kill(job.pid, signal.SIGSTOP)
        job.send(6)
        os.kill(job.pid, signal.SIGKILL)
        with pytest.raises(IdentificationError, match=r"the test ended without a result \(exit code -9\)"):
            message(job)
        with pytest.raises(IdentificationError, match="the test ended without a result"):
            job.send(7)
    finally:
        job.close()
