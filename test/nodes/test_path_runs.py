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

"""The job of a path ends where its driver is gone or silent, and nobody waits for a plan that nobody wants."""

import signal
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from std_srvs.srv import Trigger

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.nodes.compensation import path_runs
from piezo_hysteresis.nodes.identification import wait_limit

from .test_compensation_node import NODE, Compensation, scan

pytestmark = pytest.mark.nodes

SIZE, PERIOD = 1000, 1e-3


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test moves."""
    now = [100.0]
    monkeypatch.setattr(wait_limit.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def run(monkeypatch):
    """A path that is being played, with a driver that the test moves."""
    drive = np.zeros(SIZE)
    expected = SimpleNamespace(total=0.0)
    found = SimpleNamespace(
        voltage=drive, predicted=drive, wanted=drive, begin=0, sample_period=PERIOD, expected=expected
    )
    monkeypatch.setattr(path_runs, "described", lambda found, expected: "")
    sent: list[str] = []
    driver = SimpleNamespace(
        limits="any",
        missing="a driver",
        state="playing",
        first_index=0,
        command_max_age=2.0,
        sent=sent,
        send=lambda phase: sent.append(phase.name),
    )
    runs = path_runs.PathRuns(driver, SimpleNamespace(show=lambda *arguments, **named: None), {})
    return SimpleNamespace(driver=driver, runs=runs, job=runs._play("path", found))


def block(begin, size, displacement=0.0):
    index = np.arange(begin, begin + size, dtype=np.uint32)
    measured = np.full(size, displacement)
    return SampleBlock(0, PERIOD * np.arange(size), np.zeros(size), measured, index, np.ones(size, np.uint32))


def advance(run, clock, seconds):
    for _ in range(round(seconds / 0.25)):
        clock[0] += 0.25
        next(run.job)


def test_a_path_ends_where_its_driver_is_gone(run):
    next(run.job)
    run.driver.limits = None
    with pytest.raises(StageError, match="a driver is no longer there"):
        next(run.job)


def test_a_path_waits_for_a_memory_that_plays_and_not_for_one_that_stays_silent(run, clock):
    next(run.job)
    advance(run, clock, 2.0 * SIZE * PERIOD)
    run.runs.tracking.take(block(0, SIZE // 2))
    with pytest.raises(StageError, match="sends no samples of the drive"):
        advance(run, clock, 100.0)


def test_samples_of_another_driver_do_not_keep_a_path_waiting(run, clock):
    next(run.job)
    run.runs.tracking.take(block(0, SIZE // 2))

    def go_on():
        for number in range(100):
            run.runs.tracking.take(block(10 * SIZE + 10 * number, 10))
            advance(run, clock, 1.0)

    with pytest.raises(StageError, match="sends no samples of the drive"):
        go_on()


def test_a_path_that_goes_on_ends_with_its_last_sample(run, clock):
    next(run.job)
    for begin in range(0, SIZE, 100):
        advance(run, clock, 10.0)
        run.runs.tracking.take(block(begin, 100))
    with pytest.raises(StopIteration):
        next(run.job)


@pytest.mark.parametrize(("age", "wait"), [(0.5, 3.0), (2.0, 3.0), (10.0, 11.0)])
def test_a_path_is_sent_again_when_the_first_command_cannot_be_played_any_more(run, clock, age, wait):
    """The driver played the first one, which was late, and the node knew of the second one only."""
    run.driver.state, run.driver.command_max_age = "sent", age
    next(run.job)
    advance(run, clock, wait)
    assert len(run.driver.sent) == 1
    advance(run, clock, 0.5)
    assert len(run.driver.sent) == 2


@pytest.mark.parametrize("lost", ["the last block", "the reading of the last sample"])
def test_a_path_that_was_played_to_its_end_is_done_without_its_last_samples(run, lost):
    """It waited for them, and the path failed with the question whether the driver was alive."""
    next(run.job)
    tracking = run.runs.tracking
    tracking.take(block(0, SIZE - 10))
    next(run.job)
    if lost == "the last block":
        run.driver.state = "done"
        next(run.job)
        tracking.take(block(SIZE, 10))
    else:
        tracking.take(block(SIZE - 10, 10, np.nan))
    with pytest.raises(StopIteration):
        next(run.job)
    assert tracking.missing == 10 and np.array_equal(tracking.measured, np.zeros(SIZE))


def test_a_path_without_a_reading_is_not_done(run):
    next(run.job)
    run.runs.tracking.take(block(0, SIZE, np.nan))
    with pytest.raises(StageError, match="no displacement was measured"):
        next(run.job)


def test_neither_the_next_plan_nor_the_end_waits_for_a_plan_that_was_stopped(lab):
    """A plan of this many samples never ends."""
    endless = scan(duration=0.3)
    code = (
        "import sys, threading; from piezo_hysteresis.nodes.compensation import path_runs; plan = path_runs.plan; "
        f"path_runs.plan = lambda model, wanted, *a, **k: plan(model, wanted, *a, **k) if wanted.size != {endless.size}"
        " else threading.Event().wait(); "
        "from piezo_hysteresis.nodes.compensation.compensation_node import main; sys.exit(main())"
    )
    node = Compensation(lab, play=False, program=[sys.executable, "-c", code], fresh=True)
    node.send(endless, "endless")
    node.until("endless", "planning")
    assert lab.call(Trigger, f"{NODE}/stop").success
    assert lab.call(Trigger, "driver_node/release").success
    node.send(scan(), "next")
    node.until("next", "planned")
    node.send(endless, "endless_again")
    node.until("endless_again", "planning")
    node.process.signal(signal.SIGTERM)
    assert node.process.wait() == 0
