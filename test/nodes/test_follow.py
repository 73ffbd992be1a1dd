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

"""`piezo follow` shows what a node does, and ends with its job."""

import sys

import pytest

from .identification.test_identification_node import Identification

pytestmark = pytest.mark.nodes


def test_a_job_is_followed_to_its_end(lab):
    identification = Identification(lab)
    lab.wait(lambda: identification.ask("identify").success, "the identification node")
    identification.await_state("waiting")
    program = [sys.executable, "-m", "piezo_hysteresis.cli.main", "follow", "/"]
    follow = lab.start("piezo", program=program)
    lab.wait(lambda: "waiting" in follow.output, "the state under way")
    assert identification.ask("abort").success
    assert follow.wait() == 1
    assert "aborted" in follow.output.splitlines()[-1]


def test_without_a_job_it_follows_until_it_is_interrupted(lab):
    Identification(lab).await_state("idle")
    follow = lab.start("piezo", program=[sys.executable, "-m", "piezo_hysteresis.nodes.follow", "/"])
    lab.wait(lambda: "idle" in follow.output, "the state")
    assert follow.is_running


def test_a_namespace_without_a_node_is_reported(lab):
    follow = lab.start("piezo", program=[sys.executable, "-m", "piezo_hysteresis.nodes.follow", "/absent"])
    lab.wait(lambda: "no message on /absent/status yet" in follow.output, "the message")
