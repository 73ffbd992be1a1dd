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


def test_without_a_job_it_goes_on_until_it_is_interrupted(lab):
    Identification(lab).await_state("idle")
    follow = lab.start("piezo", program=[sys.executable, "-m", "piezo_hysteresis.nodes.follow", "/"])
    lab.wait(lambda: "idle" in follow.output, "the state")
    assert follow.is_running
