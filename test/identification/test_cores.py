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

"""Helper processes give the answers of one core, and end with the diagnosis, however it ends."""

import math
import operator
import os
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest

from benchmarks.naming_cases import Case
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.discrepancy.search.baseline_setup import prepare_baseline
from piezo_hysteresis.discrepancy.search.candidate_refits import refit_candidates
from piezo_hysteresis.discrepancy.search.candidates import screen
from piezo_hysteresis.effects import CATALOGUE
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.identification.cores import on_cores, start_helpers, using_cores
from piezo_hysteresis.identification.fit.time_limit import (
    TimeSpentError,
    check_time,
    end_of_search,
    ending_at,
)
from piezo_hysteresis.identification.one_core import on_one_core

OWN_SESSION = partial(os.getsid, 0)
HELPER = """
import operator, os, time
from functools import partial
from piezo_hysteresis.identification.cores import on_cores, start_helpers, using_cores
with using_cores(2):
    start_helpers()
    found = set()
    while len(found) < 2:
        found = {s for _, s in on_cores(operator.call, [partial(os.getsid, 0)] * 10)}
    print(*found - {os.getsid(0)}, flush=True)
    list(on_cores(time.sleep, [0.05] * 2000))
"""


def started():
    """Session, and so process, of a helper, when it has started."""
    start_helpers()
    end = time.monotonic() + 120.0
    while time.monotonic() < end:
        others = {s for _, s in on_cores(operator.call, [OWN_SESSION] * 10)} - {OWN_SESSION()}
        if others:
            return others.pop()
    raise TimeoutError("no helper has started")


@pytest.fixture(scope="module")
def helper():
    with using_cores(2):
        yield started()


def runs(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_loop_on_two_cores_gives_the_results_in_order(helper):
    assert list(on_cores(math.sqrt, range(50))) == [(k, math.sqrt(k)) for k in range(50)]


def test_what_a_helper_cannot_compute_is_computed_here(helper):
    assert [r for _, r in on_cores(lambda k: k + 1, range(20))] == list(range(1, 21))
    assert runs(helper)


def test_errors_are_those_of_one_core(helper):
    found = on_cores(math.sqrt, [4.0, -1.0, 9.0])
    assert next(found) == (4.0, 2.0)
    with pytest.raises(ValueError, match="math domain error"):
        next(found)


def test_an_item_that_is_no_longer_wanted_has_no_result(helper):
    largest = []
    for item, _ in on_cores(math.sqrt, range(20), lambda k: not largest or k < largest[0]):
        largest.append(item + 5)
    assert largest == [5, 6, 7, 8, 9]


def test_a_helper_keeps_the_time_limit(helper):
    later = time.monotonic() + 1e4
    with ending_at(later):
        assert {r for _, r in on_cores(operator.call, [end_of_search] * 50)} == {later}
    with ending_at(0.0), pytest.raises(TimeSpentError):
        list(on_cores(operator.call, [check_time] * 5))


@on_one_core
def test_refits_on_two_cores_are_those_of_one_core_bit_for_bit(helper):
    experiment = Case("poor", ("creep",), 20, 5e-4, "packaged").experiment()

    records, number = experiment.records, range(len(experiment.records))
    with np.errstate(all="ignore"):
        setup = prepare_baseline(records, number, None, None, False, lambda word, fraction: None)
        model, data = setup.baseline.model, setup.training_data
        screened = screen(model, data, CATALOGUE)
        refits = refit_candidates(model, screened[:3], setup.score, lambda word, fraction: None)
        with using_cores(1):
            screened_alone = screen(model, data, CATALOGUE)
            alone = refit_candidates(model, screened[:3], setup.score, lambda word, fraction: None)
    assert [(c.name, *c.score.ratios) for c in screened] == [(c.name, *c.score.ratios) for c in screened_alone]
    assert [(c.name, c.fit.values) for c in refits] == [(c.name, c.fit.values) for c in alone]


def test_no_helper_runs_after_an_error():
    found = []

    def interrupted():
        with using_cores(2):
            found.append(started())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not runs(found[0])


def test_a_helper_that_is_killed_changes_no_result():
    with using_cores(2):
        os.kill(started(), signal.SIGKILL)
        assert [r for _, r in on_cores(math.sqrt, range(20))] == [math.sqrt(k) for k in range(20)]


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_no_helper_runs_after_its_parent(end):
    with subprocess.Popen([sys.executable, "-c", HELPER], stdout=subprocess.PIPE, text=True) as parent:
        helper = int(parent.stdout.readline())
        assert runs(helper)
        parent.send_signal(end)
        try:
            parent.wait(30.0)
        finally:
            parent.kill()
    late = time.monotonic() + 30.0
    while runs(helper) and time.monotonic() < late:
        time.sleep(0.02)
    assert not runs(helper)


def test_no_helper_is_started_on_one_core(monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", None)
    monkeypatch.setenv("PYTHON_CPU_COUNT", "1")
    with using_cores():
        start_helpers()
        assert {s for _, s in on_cores(operator.call, [OWN_SESSION] * 10)} == {OWN_SESSION()}


def test_a_number_of_cores_is_positive():
    with pytest.raises(ParameterError, match="at least 1"):
        diagnose((), cores=0)
