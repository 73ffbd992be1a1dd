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

"""A fit in another process: its outcome, its failure in one line, its death, and its end."""

import operator
import os
import signal
import time

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import loads
from piezo_hysteresis.model.model_parameters import to_parameters
from piezo_hysteresis.nodes.identification.fit_jobs import identification
from piezo_hysteresis.nodes.runtime.fit_process import FitProcess
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write


@pytest.fixture
def experiment(tmp_path):
    period = 1e-3
    model = Model((BoucWen(), Arx(a=[-0.5], b=[0.5])), period, displacement_scale=1e-5)
    time_ = period * np.arange(4000)
    voltage = 5 * (1 - np.cos(2 * np.pi * time_)) * (0.4 + 0.15 * time_)
    noise = 1e-9 * np.random.default_rng(1).standard_normal(voltage.size)
    (clean,) = model.simulate(Record(voltage, voltage, period))
    write(Experiment((Record(voltage, clean + noise, period, phase="triangle"),)), tmp_path / "run")
    return tmp_path / "run"


def outcome(fit, timeout=120.0):
    deadline = time.monotonic() + timeout
    while (found := fit.poll()) is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return found


def test_the_outcome_is_that_of_the_same_fit_here(experiment):
    fit = FitProcess(identification, experiment)
    try:
        found = outcome(fit)
    finally:
        fit.close()
    here = identify(read(experiment)).model
    there = loads(found.model)
    for name, value in to_parameters(here).items():
        if name.split(".")[1] not in ("provenance", "covariance", "hash"):
            assert to_parameters(there)[name] == (pytest.approx(value, rel=1e-6) if "effects" not in name else value)
    assert "bouc_wen.beta" in found.summary
    assert "% of range" in found.verdict
    assert fit.progress[1] > 0.0


def test_a_fault_of_the_program_is_reported_as_one(tmp_path):
    fit = FitProcess(operator.not_, tmp_path)  # takes one argument
    with pytest.raises(IdentificationError, match="fault of the fit: TypeError"):
        outcome(fit)
    fit.close()


def test_a_failure_is_one_line(tmp_path):
    fit = FitProcess(identification, tmp_path / "absent")
    with pytest.raises(IdentificationError, match="no such file or folder") as error:
        outcome(fit)
    fit.close()
    assert "\n" not in str(error.value)


def test_a_death_is_reported_and_an_end_is_an_end(experiment):
    fit = FitProcess(identification, experiment)
    os.kill(fit.pid, signal.SIGKILL)
    with pytest.raises(IdentificationError, match="ended without a result"):
        outcome(fit)
    fit.close()
    fit = FitProcess(identification, experiment)
    fit.close()
    with pytest.raises(ProcessLookupError):
        os.kill(fit.pid, 0)
